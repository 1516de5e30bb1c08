"""Steps that a new plan has cut: what was done in them, though their numbers are others' now."""
