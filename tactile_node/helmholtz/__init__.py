"""From a contact pattern to the features of the Helmholtz-equation method by Volf, Dvořák and Vlček.

Each module implements one section of the paper.
"""
