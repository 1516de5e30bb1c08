"""A mission's next revision: made of a new plan, sent to the drone, taken or dropped."""
