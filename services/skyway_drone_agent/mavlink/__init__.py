"""A drone whose autopilot speaks MAVLink."""
