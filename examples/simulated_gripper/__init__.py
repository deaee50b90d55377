"""Parallel gripper with two tactile pads, simulated in MuJoCo, to develop grasp planners without hardware."""
