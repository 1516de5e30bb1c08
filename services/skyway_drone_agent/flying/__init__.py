"""What the drone does next, and doing it: one step after another."""
