"""Networks with a server of composition of their own, and the network of each drone."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "cells",
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("url", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("generation", sa.BigInteger(), nullable=False),
        sa.Column("closed_wall_ms", sa.BigInteger()),
        sa.CheckConstraint("state IN ('OPEN', 'CLOSED')", name="cell_state"),
        sa.PrimaryKeyConstraint("network_id"),
        sa.UniqueConstraint("generation"),
    )
    op.add_column("drones", sa.Column("network_id", sa.Text()))
