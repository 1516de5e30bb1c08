"""Quotes whose offers composition holds until they expire."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("quotes", sa.Column("hold_id", sa.Text(), nullable=True))
    op.create_index(
        "quotes_held",
        "quotes",
        ["expires_wall_ms"],
        sqlite_where=sa.text("hold_id IS NOT NULL"),
        postgresql_where=sa.text("hold_id IS NOT NULL"),
    )
