"""Turn a contact pattern into the features of the Helmholtz-equation method by Volf, Dvořák and Vlček.

Each module implements one section of the paper.
"""
