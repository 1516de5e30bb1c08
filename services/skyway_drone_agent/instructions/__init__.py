"""Instructions of the cloud: handled in order, each with one final answer."""
