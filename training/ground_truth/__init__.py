"""What is true of a contact whatever is trained: stress by contact mechanics, overlap with each shape.

Training and benchmark share it, so it imports nothing else of training (test/test_architecture.py).
"""
