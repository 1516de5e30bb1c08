"""The broker: a client that connects again for ever, and how a broker is set up."""
