"""What a skin is: layout, EDS, pads, and how payloads become taxel values."""
