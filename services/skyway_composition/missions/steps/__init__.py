"""The steps of missions: made from plans, kept as they were sent, and how they ended."""
