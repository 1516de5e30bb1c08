"""Requests that wait for a drone have an order, and are woken by what changes."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    for column in (
        sa.Column("network_id", sa.Text(), nullable=True),
        sa.Column("queue_rank", sa.SmallInteger(), server_default="1", nullable=False),
        sa.Column("waits_since_ms", sa.BigInteger(), nullable=True),
        sa.Column("woken_wall_ms", sa.BigInteger(), server_default="0", nullable=False),
    ):
        op.add_column("deliveries", column)
    op.create_index(
        "deliveries_waiting",
        "deliveries",
        ["network_id", "queue_rank", "created_ms", "delivery_id"],
        sqlite_where=sa.text("waits_since_ms IS NOT NULL"),
        postgresql_where=sa.text("waits_since_ms IS NOT NULL"),
    )
