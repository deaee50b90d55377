"""Generators of the reference pages in docs/reference/. `make reference` writes their output into the pages."""
