"""Sources of taxel frames: a live bus, which is supervised and repaired, and a recorded log."""
