"""Shared trips: which deliveries fly with the mission of another one."""

import sqlalchemy as sa
from alembic import op

revision = "0019"
down_revision = "0018"
branch_labels = None
depends_on = None

_TO_JOIN = sa.text("state = 'QUEUED' AND pooling_at IS NOT NULL")


def upgrade() -> None:
    op.add_column("missions", sa.Column("shares", sa.Text(), nullable=True))
    op.add_column("missions", sa.Column("pooling_at", sa.Text(), nullable=True))
    op.create_index(
        "missions_to_join",
        "missions",
        ["pooling_at"],
        sqlite_where=_TO_JOIN,
        postgresql_where=_TO_JOIN,
    )
    op.create_table(
        "guests",
        sa.Column("mission_id", sa.Text(), primary_key=True),
        sa.Column("host_id", sa.Text(), sa.ForeignKey("missions.mission_id"), nullable=False),
        sa.Column(
            "delivery_id", sa.Text(), sa.ForeignKey("deliveries.delivery_id"), nullable=False
        ),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.UniqueConstraint("delivery_id", "attempt", name="guest_attempt"),
    )
    op.create_index("guests_by_host", "guests", ["host_id"])
