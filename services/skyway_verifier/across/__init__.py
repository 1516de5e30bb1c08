"""What must always hold between two databases: `rules` lists all rules across services."""
