"""Whether the plan of a mission still holds."""
