"""The way to the cloud: envelopes, presence, events, and whether the link is up."""
