"""Quarantine: the messages of drones that cannot be taken, for operators to look at.

`set_aside` keeps them, within bounds, as `quarantined` messages; `offenders` decides whose messages
are not read any more. `missions.following.replay` handles a message again.
"""
