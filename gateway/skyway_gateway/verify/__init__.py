"""Verification: what must always hold in the gateway's database (docs/reference/invariants.md).

`rules` lists all rules. Each file has the rules of one subject: `deliveries`, their `packages` with
the `custody` of each, their `missions` and `events`, the `notifications` of webhooks, and `calls`:
the audit log and the answers that are stored. `facts` are compared with other services.
"""
