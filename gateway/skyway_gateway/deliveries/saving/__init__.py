"""How a delivery is written: with all its parts, or not at all."""
