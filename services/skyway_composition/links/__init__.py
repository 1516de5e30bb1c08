"""The link to each drone: what goes to it, in order, and how far we know what comes from it."""
