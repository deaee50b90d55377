"""Combine two opposing pads into one grasp, and close and hold with a gripper."""
