"""What the drone reports: state, events and telemetry."""
