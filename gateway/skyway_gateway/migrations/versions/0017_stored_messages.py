"""The moment at which each message of the outbox was stored."""

import sqlalchemy as sa
from alembic import op

revision = "0017"
down_revision = "0016"
branch_labels = None
depends_on = None


def upgrade() -> None:
    stored: sa.Column[int] = sa.Column(
        "stored_wall_ms", sa.BigInteger(), nullable=False, server_default="0"
    )
    op.add_column("outbox", stored)
