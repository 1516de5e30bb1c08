"""What every process stands on: database, outbox, MQTT, HTTP, identity, clock, loops, logs."""
