"""Who confirms what is loaded on a provider's drones."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column(
        "providers", sa.Column("loading", sa.Text(), server_default="AUTOMATIC", nullable=False)
    )
