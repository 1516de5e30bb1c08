"""What must always hold in the registry's database: `rules` has all rules and reads the facts."""
