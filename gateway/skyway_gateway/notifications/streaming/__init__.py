"""A delivery's events for who listens: as they happen, over one HTTP answer."""
