"""Who confirms what is loaded on a provider's drones; numbers that show what has changed."""

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
    op.add_column(
        "presence", sa.Column("changed", sa.BigInteger(), server_default="0", nullable=False)
    )
    op.create_index("presence_by_change", "presence", ["changed"])
    op.create_table(
        "changes",
        sa.Column("only", sa.SmallInteger(), autoincrement=False, nullable=False),
        sa.Column("latest", sa.BigInteger(), nullable=False),
        sa.Column("providers", sa.BigInteger(), nullable=False),
        sa.Column("removals", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("only"),
    )
