"""The MQTT client, which reconnects until it is stopped."""
