"""By when nine of ten packages should come, and an index of the last packages that have come."""

import sqlalchemy as sa
from alembic import op

revision = "0022"
down_revision = "0021"
branch_labels = None
depends_on = None


def upgrade() -> None:
    p90: sa.Column[int] = sa.Column("promised_p90_ms", sa.BigInteger(), nullable=True)
    op.add_column("packages", p90)
    has_come = sa.text("delivered_ms IS NOT NULL")
    op.create_index(
        "packages_delivered",
        "packages",
        ["delivered_ms"],
        sqlite_where=has_come,
        postgresql_where=has_come,
    )
