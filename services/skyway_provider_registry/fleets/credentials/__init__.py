"""Credentials of drones: how one gets them, changes them, and loses them."""
