"""Following: what drones report changes their missions.

`follow` reads the messages in batches, handles a batch in one transaction, and sets aside messages
that cannot be handled. `handle_ack`, `handle_report` and
`handle_failure` handle one message each. `advance` moves a mission on and passes its packages on,
`recover_packages` brings back packages of missions that were given up. `quarantine_routes`
handles a message again that was set aside.
"""
