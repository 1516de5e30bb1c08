"""Providers: who owns a fleet, and what they ask for a delivery."""
