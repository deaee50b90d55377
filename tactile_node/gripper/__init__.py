"""The gripper controller: the node `touch_gripper`, its client for planners, and the rules that both follow."""
