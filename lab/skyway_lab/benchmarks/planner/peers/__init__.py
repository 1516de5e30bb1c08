"""Solvers from PyPI, each in a file of its own, on the part of the problem that it can do."""
