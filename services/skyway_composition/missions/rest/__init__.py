"""The rest of a mission under way: from where it can be planned anew, and how it may end."""
