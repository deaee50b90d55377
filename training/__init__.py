"""Trains the learned recogniser: draws contacts under nominal and field conditions, trains, calibrates, writes weights.

Run `make train`, or in the environment of `make bench`: python -m training.train --output config/recogniser.npz. It
needs the packages of requirements/bench.in (torch), which tactile_node does not; nothing here is installed on a robot.
"""
