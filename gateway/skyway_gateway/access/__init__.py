"""API keys: who is calling, and in which role."""
