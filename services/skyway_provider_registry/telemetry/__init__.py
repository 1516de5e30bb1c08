"""What drones measured: every sample for a day, averages of minutes for a month, by time."""
