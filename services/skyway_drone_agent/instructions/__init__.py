"""What the cloud asks: in order, each answered once and for all."""
