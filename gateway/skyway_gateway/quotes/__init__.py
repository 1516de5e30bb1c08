"""Offers before a delivery is requested: they reserve nothing."""
