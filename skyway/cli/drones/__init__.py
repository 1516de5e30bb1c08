"""`skyway drone` and `skyway fleet`: both start the drone agent with options of their own."""
