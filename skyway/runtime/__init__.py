"""What every process stands on.

Packages: `sql` (a service's own database), `outbox` (messages that leave with a transaction),
`idempotency` (calls that may come again), `http` (between services and from outside), `mqtt` (the
broker). Beside them what all of these use: clock, loops, logs, metrics, settings, errors.
"""
