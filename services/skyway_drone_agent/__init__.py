"""The drone level: one drone, or a simulated fleet, that flies what the cloud instructs.

What happened is a file of records (`journal`), what follows from them a `logbook`; `inbox` answers
instructions, `mission` decides the next act, `vehicle` does it, `reporter` tells the cloud. The
`cockpit` puts them together, the `agent` links them to the cloud.
Read `flying.mission` first.
"""
