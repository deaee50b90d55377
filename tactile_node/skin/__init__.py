"""Description of a skin: layout, EDS and pads, and the conversion of payloads into taxel values."""
