"""What composition says of missions, and so of the drones that fly them."""
