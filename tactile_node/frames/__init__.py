"""What any source of taxel frames gives and reports: frames, losses, health."""
