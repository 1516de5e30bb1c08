"""What planning all requests of a fleet together is worth: see docs/dispatch.md."""
