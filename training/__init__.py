"""Train the learned recogniser.

Training draws contacts under nominal and field conditions, trains and calibrates the network, and writes the weights.

Run `make train`, or run ``python -m training.train --output config/recogniser.npz`` in the environment of `make bench`.
Training needs the packages in requirements/bench.in (torch), which tactile_node does not need. A robot needs nothing
from this folder.
"""
