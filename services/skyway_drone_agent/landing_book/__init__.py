"""The landing book: stations around the drones' routes, also those that no mission names."""
