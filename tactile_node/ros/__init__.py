"""What nodes share: messages from results, parameters, QoS profiles."""
