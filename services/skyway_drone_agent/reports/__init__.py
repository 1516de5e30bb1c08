"""What the drone tells of itself: state, events, thinned telemetry."""
