"""Pose and size of a contact with a known shape, with covariance; and quantities that do not depend on the shape."""
