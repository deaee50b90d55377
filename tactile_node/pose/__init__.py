"""Estimate the pose and size of a contact with a known shape, and the quantities of a contact of any shape."""
