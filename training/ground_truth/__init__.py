"""Compute the ground truth of a contact, independently of any training.

The ground truth is the stress computed by contact mechanics, and the overlap with each shape.

Training and benchmarks share this package, so the package imports nothing else from training
(test/test_architecture.py).
"""
