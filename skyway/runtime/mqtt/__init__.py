"""The broker: a client that reconnects for ever, and the files that configure a broker."""
