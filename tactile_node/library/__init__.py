"""What `import tactile_node` offers a program of its own: arrays in, tuples out; neither ROS nor CAN nor paths."""
