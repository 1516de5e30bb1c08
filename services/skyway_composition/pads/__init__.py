"""Who holds which pad of a station when, and telling the world how taken stations are."""
