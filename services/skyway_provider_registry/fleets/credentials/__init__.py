"""Credentials of drones: a drone enrols, rotates its credentials, and its provider revokes them."""
