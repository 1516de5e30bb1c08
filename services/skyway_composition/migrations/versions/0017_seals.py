"""A database is sealed while its cell moves to another server."""

import sqlalchemy as sa
from alembic import op

revision = "0017"
down_revision = "0016"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "seals",
        sa.Column("kind", sa.Text, primary_key=True),
        sa.Column("seal_id", sa.Text, nullable=False),
        sa.Column("made_wall_ms", sa.BigInteger, nullable=False),
        sa.CheckConstraint("kind IN ('SEALED', 'COPIED')", name="seal_kind"),
    )
