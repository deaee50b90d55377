"""Combine two opposing pads into one grasp."""
