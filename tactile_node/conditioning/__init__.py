"""Correct the values of each taxel frame before contacts are found."""
