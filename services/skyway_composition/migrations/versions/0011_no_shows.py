"""Missions whose drones did not come."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "no_shows",
        sa.Column("mission_id", sa.Text, sa.ForeignKey("missions.mission_id"), primary_key=True),
        sa.Column("provider_id", sa.Text, nullable=False),
        sa.Column("drone_id", sa.Text, nullable=False),
        sa.Column("code", sa.Text, nullable=False),
        sa.Column("at_ms", sa.BigInteger, nullable=False),
    )
    op.create_index("no_shows_by_time", "no_shows", ["at_ms", "provider_id"])
