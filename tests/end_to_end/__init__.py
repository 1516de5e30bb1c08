"""A package to pytest, so that tests that follow one another share a running system."""
