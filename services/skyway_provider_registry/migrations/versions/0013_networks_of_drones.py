"""Each drone has the network of its home; null for the drones that are there already."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("drones", sa.Column("network_id", sa.Text(), nullable=True))
