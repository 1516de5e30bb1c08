"""Who holds each package, from the pickup station to the recipient."""
