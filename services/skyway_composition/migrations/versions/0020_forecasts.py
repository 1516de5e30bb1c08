"""The forecast with which a network plans."""

import sqlalchemy as sa
from alembic import op

revision = "0020"
down_revision = "0019"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "forecasts",
        sa.Column("network_id", sa.Text(), sa.ForeignKey("networks.network_id"), primary_key=True),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("received_ms", sa.BigInteger(), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.Column("measured", sa.Text(), nullable=True),
    )
