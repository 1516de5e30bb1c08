"""What a booking has to know before it plans."""
