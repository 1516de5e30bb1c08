"""Cancelling deliveries or packages: all that can still be stopped is stopped."""
