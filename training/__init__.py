"""Train the learned recogniser: draw contacts under nominal and field conditions, train, calibrate and write weights.

Run `make train`, or run ``python -m training.train --output config/recogniser.npz`` in the environment of `make bench`.
Training needs the packages in requirements/bench.in (torch), which tactile_node does not need. Nothing in this folder
is installed on a robot.
"""
