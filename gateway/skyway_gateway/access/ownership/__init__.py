"""Whose things are, and who may see them."""
