"""Taxel frame -> taxel frame: what is done to values before anybody looks for a contact in them."""
