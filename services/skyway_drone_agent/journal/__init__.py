"""What a drone needs after a crash: records on disk, and the logbook that they add up to."""
