"""Quarantine: the messages of drones that cannot be taken, for operators to look at.

`set_aside` keeps them, within bounds, as `quarantined` messages, and decides whose messages are not
read any more. `missions.following.quarantine_routes` handles a message again.
"""
