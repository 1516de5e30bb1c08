"""The messages between the cloud and a drone: instructions and their acks, state and telemetry."""
