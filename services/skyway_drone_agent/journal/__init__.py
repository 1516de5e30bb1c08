"""What a drone must still know after a crash: records on disk, and the logbook they add up to."""
