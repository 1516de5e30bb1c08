"""The way to the cloud: envelopes, presence, events, heartbeat, and the monitors of the link."""
