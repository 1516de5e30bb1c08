"""What was done by operators and providers: one entry per call that may change something."""
