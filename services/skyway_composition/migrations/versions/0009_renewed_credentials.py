"""When the credentials of drones were renewed."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("drone_links", sa.Column("renewed_ms", sa.BigInteger(), nullable=True))
