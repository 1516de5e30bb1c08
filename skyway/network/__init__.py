"""The skyway network: stations with pads, directed segments between them, zones above them."""
