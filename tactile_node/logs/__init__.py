"""CAN logs and bags, written and read."""
