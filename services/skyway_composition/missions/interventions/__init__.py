"""What people do to missions: load, command, cancel."""
