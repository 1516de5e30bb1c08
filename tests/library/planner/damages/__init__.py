"""Good plans, and every way in which one can be damaged."""
