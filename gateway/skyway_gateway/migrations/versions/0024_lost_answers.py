"""Since when composition was asked to book a delivery and has not answered."""

import sqlalchemy as sa
from alembic import op

revision = "0024"
down_revision = "0023"
branch_labels = None
depends_on = None


def upgrade() -> None:
    asked: sa.Column[int] = sa.Column("asked_wall_ms", sa.BigInteger(), nullable=True)
    op.add_column("deliveries", asked)
