"""Packages that lie with a drone away from every station."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("packages", sa.Column("position", sa.Text(), nullable=True))
