"""Accepting delivery requests and offers: checked, written once, handed to booking."""
