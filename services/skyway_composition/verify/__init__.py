"""Whether the invariants of composition's database hold (reliability.md I1 to I4, I6, I7, I12)."""
