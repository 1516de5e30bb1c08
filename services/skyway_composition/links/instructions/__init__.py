"""What was sent to drones, and what they answered."""
