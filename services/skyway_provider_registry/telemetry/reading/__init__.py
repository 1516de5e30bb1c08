"""What is kept of a drone's telemetry, by time: samples or minutes, JSON or GeoJSON."""
