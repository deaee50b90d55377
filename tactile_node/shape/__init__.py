"""Recognise the shape of a contact pattern."""
