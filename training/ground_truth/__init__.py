"""Ground truth about a contact, independent of any training: stress by contact mechanics, and overlap with each shape.

Training and benchmarks share this package, so it imports nothing else from training (test/test_architecture.py).
"""
