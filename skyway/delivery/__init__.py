"""What a customer asks (`request`), what a provider offers (`offer`), how it is flown (`plan`)."""
