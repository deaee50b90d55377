"""Measure a gripper and its two pads on the desk, and prove the parameters that come from the measurements."""
