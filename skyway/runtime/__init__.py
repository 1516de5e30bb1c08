"""What every process uses.

Folders: `sql` (a service's own database), `outbox` (messages that are stored with a transaction and
sent after it), `http` (between services and from outside), `mqtt` (the broker). Files:
idempotency_store (calls that may be repeated), limits, clock, loops, tracing, metrics, settings,
errors and others.
"""
