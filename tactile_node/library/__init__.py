"""What `import tactile_node` offers other programs: arrays in, tuples out; neither ROS nor CAN nor paths."""
