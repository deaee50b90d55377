"""Taxel frame -> contact pattern: which taxels are pressed, together."""
