"""Links that log a browser in once."""

import sqlalchemy as sa
from alembic import op

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "session_links",
        sa.Column("code_hash", sa.Text(), primary_key=True),
        sa.Column("key_id", sa.Text(), sa.ForeignKey("api_keys.key_id"), nullable=False),
        sa.Column("expires_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("used_wall_ms", sa.BigInteger()),
        sa.CheckConstraint("used_wall_ms <= expires_wall_ms", name="session_link_used"),
    )
    op.create_index("session_links_by_key", "session_links", ["key_id", "expires_wall_ms"])
    op.create_index("session_links_by_expiry", "session_links", ["expires_wall_ms"])
