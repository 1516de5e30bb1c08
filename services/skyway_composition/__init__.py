"""Composition decides what is flown. It owns networks, reservations of pads and drones, missions.

Folders: `networks` (versions of skyway networks), `pads` (reservations of pads), `planning` (how a
request could be flown), `missions` (book a plan and follow its flight), `links` (messages to and
from drones), `closures` (what is closed), `statistics` (how pads and drones were used),
`retention` (deletes what is old).
`alarm_store` and `alarm_routes` are the problems that an operator must look at. `own_cells`
says which networks are served here. `parts` holds what
the folders share, `work` the loops that run beside the `app`, `verify` checks the invariants of the
database.
"""
