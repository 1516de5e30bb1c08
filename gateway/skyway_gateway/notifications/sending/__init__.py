"""What is due at webhooks, sent until somebody has it."""
