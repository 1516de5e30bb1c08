"""The dispatcher: the promised arrivals of each mission, and what better orders have saved."""

import sqlalchemy as sa
from alembic import op

revision = "0018"
down_revision = "0016"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("missions", sa.Column("promised", sa.Text(), nullable=True))
    op.create_table(
        "better_orders",
        sa.Column("provider_id", sa.Text(), primary_key=True),
        sa.Column("day_ms", sa.BigInteger(), primary_key=True),
        sa.Column("orders", sa.Integer(), nullable=False),
        sa.Column("moves", sa.Integer(), nullable=False),
        sa.Column("saved_ms", sa.BigInteger(), nullable=False),
    )
