"""When the last state of a drone was received, and alarms about drones that jumped."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("presence", sa.Column("state_seen_ms", sa.BigInteger(), nullable=True))
    op.create_table(
        "waiting_alarms",
        sa.Column(
            "drone_id",
            sa.Text,
            sa.ForeignKey("drones.drone_id", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column("alarm", sa.Text, nullable=False),
    )
