"""Keys of drones: what an enrolled drone shows when it calls REST, and how it rotates it."""
