"""Learn from touches: the response of a skin, the reliability of recognition on a skin, and taught shapes."""
