"""`make demo`: a simulated gripper skin is touched by a script, and the results are shown from taxel to shape."""
