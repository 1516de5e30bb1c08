"""The moment to which the gateway holds a delivery: as the customer asked, P90 or P50."""

import sqlalchemy as sa
from alembic import op

revision = "0023"
down_revision = "0022"
branch_labels = None
depends_on = None


def upgrade() -> None:
    due: sa.Column[int] = sa.Column("due_ms", sa.BigInteger(), nullable=True)
    op.add_column("packages", due)
