"""CAN frames -> taxel frames."""
