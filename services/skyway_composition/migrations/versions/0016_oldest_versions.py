"""A network remembers from which version on its versions are kept."""

import sqlalchemy as sa
from alembic import op

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column(
        "networks", sa.Column("oldest_version", sa.Integer, nullable=False, server_default="1")
    )
