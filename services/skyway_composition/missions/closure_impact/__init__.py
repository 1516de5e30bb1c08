"""Which missions a closure hits."""
