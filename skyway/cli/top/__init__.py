"""`skyway top`: `reader` asks the gateway, `screen` shows the answers, `command` runs both."""
