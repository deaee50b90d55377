"""Pose and size of a contact whose shape is known, with covariance; and what needs no shape."""
