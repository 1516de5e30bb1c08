"""The gateway keeps the stations of networks, so that it can check requests without composition."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "known_networks",
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("stations", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("network_id"),
    )
