"""`make demo`: a scripted gripper skin, watched from taxel to shape."""
