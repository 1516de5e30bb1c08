"""Old deliveries, audit entries and webhook attempts can be deleted."""

import sqlalchemy as sa
from alembic import op

revision = "0019"
down_revision = "0018"
branch_labels = None
depends_on = None

_IS_OVER = (
    "(state || '') IN ('COMPLETED', 'PARTIALLY_COMPLETED', 'CANCELLED', 'FAILED', 'REJECTED')"
)


def upgrade() -> None:
    leaving: sa.Column[bool] = sa.Column(
        "is_leaving", sa.Boolean(), nullable=False, server_default=sa.false()
    )
    op.add_column("deliveries", leaving)
    op.create_index(
        "deliveries_over",
        "deliveries",
        ["updated_ms"],
        sqlite_where=sa.text(_IS_OVER),
        postgresql_where=sa.text(_IS_OVER),
    )
    op.create_index("notifications_by_event", "notifications", ["event_id"])
    entries: sa.Column[int] = sa.Column(
        "pruned_entries", sa.BigInteger(), nullable=False, server_default="0"
    )
    op.add_column("audit_head", entries)
    last: sa.Column[str] = sa.Column(
        "pruned_hash", sa.Text(), nullable=False, server_default=sa.text("''")
    )
    op.add_column("audit_head", last)
    op.create_table(
        "pruned",
        sa.Column("table_name", sa.Text(), primary_key=True),
        sa.Column("before_wall_ms", sa.BigInteger(), nullable=False),
    )
