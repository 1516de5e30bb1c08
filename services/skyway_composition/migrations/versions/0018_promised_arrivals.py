"""The arrival times with which each mission was booked: the dispatcher keeps them."""

import sqlalchemy as sa
from alembic import op

revision = "0018"
down_revision = "0017"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("missions", sa.Column("promised", sa.Text(), nullable=True))
