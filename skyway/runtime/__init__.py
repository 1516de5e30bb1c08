"""What every process uses.

Folders: `sql` (a service's own database), `outbox` (messages that are stored with a transaction and
sent after it), `idempotency` (calls that may be repeated), `http` (between services and from
outside), `mqtt` (the broker). Files: clock, loops, logs, metrics, settings, errors and others.
"""
