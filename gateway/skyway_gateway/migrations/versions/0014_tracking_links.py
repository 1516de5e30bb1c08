"""Tracking links that were renewed or withdrawn."""

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "tracking_links",
        sa.Column(
            "delivery_id", sa.Text(), sa.ForeignKey("deliveries.delivery_id"), primary_key=True
        ),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("is_withdrawn", sa.Boolean(), nullable=False),
        sa.CheckConstraint("number >= 1", name="tracking_link_number"),
    )
