"""Trains the learned recogniser; needs the packages of requirements/bench.in, which tactile_node does not."""
