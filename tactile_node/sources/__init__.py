"""Keeps a live bus and its nodes working."""
