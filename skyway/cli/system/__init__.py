"""`skyway up`: a whole local system, from its secrets and databases to its supervised processes."""
