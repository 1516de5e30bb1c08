"""What the drone reports: acks, state and telemetry."""
