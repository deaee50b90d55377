"""The interface of `import tactile_node` for other programs: arrays in, tuples out, without ROS or CAN."""
