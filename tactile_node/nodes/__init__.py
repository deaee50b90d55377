"""The ROS 2 nodes, which are thin shells around the processing stages."""
