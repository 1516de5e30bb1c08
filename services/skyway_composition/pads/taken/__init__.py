"""How taken stations are: counted, and told to everybody."""
