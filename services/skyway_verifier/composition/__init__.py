"""What must always hold in composition's database.

`rules` lists all rules. Each other file has the rules of one subject: `missions` and the reports
about them, their `steps`, drones' `calendars`, the `custody` of packages and the `proofs` of their
hand-overs, `pads` and held offers, `networks` and their closures, and the `links` to drones.
`evidence` reads what several rules need.
"""
