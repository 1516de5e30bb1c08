"""What goes wrong, and what the drone does about it by itself."""
