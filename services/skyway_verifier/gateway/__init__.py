"""What must always hold in the gateway's database.

`rules` lists all rules. Each file has the rules of one subject: `deliveries` with their missions,
accepted `offers`, `packages` with the custody of each, `events` with the notifications of webhooks,
and `calls`: keys, the audit log and stored answers.
"""
