"""What drones say of themselves, kept if it is news."""
