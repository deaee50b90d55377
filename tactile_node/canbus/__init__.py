"""CAN frames of a live bus or a log -> taxel frames."""
