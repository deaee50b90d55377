"""The rules of the gripper controller, which know neither ROS nor CAN and read no clock."""
