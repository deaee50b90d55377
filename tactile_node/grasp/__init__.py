"""Two opposing pads as one grasp."""
