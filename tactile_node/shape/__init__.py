"""From a contact pattern to the recognised shape."""
