"""Changes: numbers by which a reader finds what has changed since it looked last."""
