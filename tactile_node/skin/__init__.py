"""Describe a skin by its layout, EDS and pads, and convert CAN payloads into taxel values."""
