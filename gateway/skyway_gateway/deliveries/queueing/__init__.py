"""Deliveries with packages that wait: who books which of them, until when."""
