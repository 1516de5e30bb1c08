"""What pads and drones were used for, from the steps that have ended."""
