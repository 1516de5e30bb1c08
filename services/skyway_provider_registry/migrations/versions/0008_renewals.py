"""When the credentials of drones were renewed, and whether composition was notified."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "renewals",
        sa.Column(
            "drone_id",
            sa.Text,
            sa.ForeignKey("drones.drone_id", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column("renewed_ms", sa.BigInteger, nullable=False),
        sa.Column("renewed_wall_ms", sa.BigInteger, nullable=False),
        sa.Column("is_announced", sa.Boolean, nullable=False),
    )
    op.create_index(
        "renewals_to_announce",
        "renewals",
        ["renewed_wall_ms"],
        sqlite_where=sa.text("is_announced = 0"),
        postgresql_where=sa.text("NOT is_announced"),
    )
