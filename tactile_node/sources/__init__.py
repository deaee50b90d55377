"""Sources of taxel frames: a live bus, which is supervised and recovered after faults, and a recorded log."""
