"""The landing book: the stations around the drones' routes, also those that no mission names."""
