"""Public calls that another service answers: one row of a table each."""
