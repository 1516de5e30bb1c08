"""What customers are told: each delivery event once in sequence, by webhook, SSE and MQTT."""
