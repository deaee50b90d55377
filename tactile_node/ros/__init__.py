"""Code that the ROS nodes share: messages made from results, checks of messages, parameters and QoS profiles."""
