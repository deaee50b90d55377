"""Compute ground truth about a contact, independent of any training.

The ground truth is the stress by contact mechanics, and the overlap with each shape.

Training and benchmarks share this package, so the package imports nothing else from training
(test/test_architecture.py).
"""
