"""The live replicas of the gateway: one of them runs the sweeps for all."""

import sqlalchemy as sa
from alembic import op

revision = "0021"
down_revision = "0019"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "replicas",
        sa.Column("replica_id", sa.Text, primary_key=True),
        sa.Column("joined_wall_ms", sa.BigInteger, nullable=False),
        sa.Column("seen_wall_ms", sa.BigInteger, nullable=False),
        sa.Column("is_listening", sa.Boolean, nullable=False),
    )
