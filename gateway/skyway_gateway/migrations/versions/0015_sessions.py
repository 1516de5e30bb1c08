"""Sessions of browsers."""

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "sessions",
        sa.Column("session_hash", sa.Text(), primary_key=True),
        sa.Column("key_id", sa.Text(), sa.ForeignKey("api_keys.key_id"), nullable=False),
        sa.Column("expires_wall_ms", sa.BigInteger(), nullable=False),
    )
    op.create_index("sessions_by_key", "sessions", ["key_id", "expires_wall_ms"])
    op.create_index("sessions_by_expiry", "sessions", ["expires_wall_ms"])
