"""The ROS 2 nodes: thin shells around the processing stages."""
