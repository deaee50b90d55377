"""A parallel gripper with two tactile pads in physics (MuJoCo), for those who write grasp planners without hardware."""
