"""Assemble CAN frames into taxel frames, and describe the health of bus and nodes."""
