"""What the launch files start, and what they share."""
