"""What thinning telemetry on board saves."""
