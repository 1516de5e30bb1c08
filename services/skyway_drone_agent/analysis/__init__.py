"""Estimates from the sensors: charge, health, wind, energy use, and landings in reach."""
