"""Composition: what is flown. It owns networks, reservations of pads and drones, and missions.

Rooms: `networks` (versions of skyway networks), `pads` (who holds which pad when), `planning` (how
a request could be flown: heavy, changes nothing), `missions` (booking a plan and flying it),
`links` (what goes to each drone, and how far we know what comes), `closures` (what happens in the
world), `alarms` (what an operator should look at), `statistics` (what pads and drones did).
`parts` is what they share, `work` the loops that run beside the `app`, `verify` whether the
invariants of the database hold.
"""
