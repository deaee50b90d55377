"""The Python interface (`import tactile_node`) for other programs, which needs neither ROS nor CAN.

The functions of the interface take arrays and return tuples.
"""
