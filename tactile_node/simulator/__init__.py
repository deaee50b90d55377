"""A simulated CANopen skin: contacts or recordings -> CAN frames."""
