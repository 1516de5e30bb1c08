"""What customers asked for: accepted, booked, and followed to the last package."""
