"""The trace of each mission."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("missions", sa.Column("traceparent", sa.Text(), nullable=True))
