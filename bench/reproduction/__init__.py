"""Reproduction of the paper's figures and claims, run by bench/reproduce.py."""
