"""Operate one live CAN bus: configure its devices, send SYNC, and receive and record CAN frames."""
