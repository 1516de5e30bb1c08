"""The remainder of a mission under way: where a new plan begins, and how it may end."""
