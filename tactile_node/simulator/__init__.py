"""A simulated CANopen skin, which turns contacts or recordings into CAN frames."""
