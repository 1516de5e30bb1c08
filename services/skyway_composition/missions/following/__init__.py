"""What drones say (`follow`): acks, events and states become what is known of missions."""
