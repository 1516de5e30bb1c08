"""Which missions are to be looked at because time has passed, or because they wait for a plan."""
