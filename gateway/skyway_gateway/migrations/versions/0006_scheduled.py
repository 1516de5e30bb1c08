"""Deliveries that wait as SCHEDULED until their pickup comes within the booking horizon."""

import sqlalchemy as sa
from alembic import op

from skyway.runtime.sql.migrations import replace_check

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("deliveries", sa.Column("earliest_pickup_ms", sa.BigInteger(), nullable=True))
    replace_check(
        op.get_bind(),
        "deliveries",
        "delivery_state",
        "state IN ('SCHEDULED', 'REQUESTED', 'PLANNED', 'DISPATCHED', 'LOADING', 'IN_PROGRESS', "
        "'COMPLETED', 'PARTIALLY_COMPLETED', 'CANCELLED', 'FAILED', 'REJECTED')",
    )
    op.create_index(
        "deliveries_scheduled",
        "deliveries",
        ["earliest_pickup_ms"],
        sqlite_where=sa.text("state = 'SCHEDULED'"),
        postgresql_where=sa.text("state = 'SCHEDULED'"),
    )
