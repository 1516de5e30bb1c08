"""What providers earn with the missions they complete."""
