"""Verification: what must always hold in composition's database (docs/reference/invariants.md).

`rules` lists all rules. Each file has the rules of one subject: `missions`, their `steps`, the
`custody` of packages, `pads`, `closures`, `networks`, the `links` to drones, and the `reports` to
other services. `sent_steps` and `package_stories` read what several rules need. `facts` are
compared with other services.
"""
