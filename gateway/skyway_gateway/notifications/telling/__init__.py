"""What is kept of a delivery's new events: the events, and for whom they are due."""
