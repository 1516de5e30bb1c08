"""Idle drones may wait near the next pickup that is expected."""

from alembic import op

from skyway.runtime.sql.migrations import replace_check

revision = "0018"
down_revision = "0017"
branch_labels = None
depends_on = None

_CHOICES = "standby IN ('HOME', 'STAY', 'PARKING', 'NEXT_PICKUP')"


def upgrade() -> None:
    replace_check(op.get_bind(), "providers", "provider_standby", _CHOICES)
    replace_check(op.get_bind(), "drones", "drone_standby", _CHOICES)
