"""One live CAN bus."""
