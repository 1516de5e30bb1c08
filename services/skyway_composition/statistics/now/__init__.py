"""What is under way now: missions by state, and messages that have not left."""
