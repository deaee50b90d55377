"""Features -> recognised shape."""
