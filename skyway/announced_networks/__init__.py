"""What a process knows of networks without asking, since their versions are announced on MQTT."""
