"""The Python interface (`import tactile_node`) for other programs, which needs neither ROS nor CAN."""
