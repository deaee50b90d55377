"""The synthetic world: contacts of the five shapes in general position."""
