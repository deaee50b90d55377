"""Contact pattern -> features of Volf, Dvořák and Vlček's Helmholtz-equation method, a module a section."""
