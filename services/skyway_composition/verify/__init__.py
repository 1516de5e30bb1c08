"""Check I1 to I4, I6, I7 and I12 in composition's database (docs/reference/invariants.md)."""
