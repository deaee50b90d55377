"""Operate one live CAN bus: configure its devices, send SYNC, receive and record its frames."""
