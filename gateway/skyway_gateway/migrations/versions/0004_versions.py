"""A delivery counts its writes, so that what was read earlier can be written from safely."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column(
        "deliveries", sa.Column("version", sa.Integer(), server_default="0", nullable=False)
    )
