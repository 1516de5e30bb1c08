"""A drone that exists only as physics, and what disturbs it."""
