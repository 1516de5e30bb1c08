"""API keys with a name, scopes and an expiry, which are rotated."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None

_ENDS = "deleted_wall_ms IS NULL AND ends_wall_ms IS NOT NULL"
_IS_NEXT = "is_next AND deleted_wall_ms IS NULL"


def upgrade() -> None:
    for name in ("name", "scopes", "replaces_key_id"):
        op.add_column("api_keys", sa.Column(name, sa.Text(), nullable=True))
    for name in ("expires_wall_ms", "ends_wall_ms"):
        op.add_column("api_keys", sa.Column(name, sa.BigInteger(), nullable=True))
    is_next: sa.Column[bool] = sa.Column(
        "is_next", sa.Boolean(), nullable=False, server_default=sa.false()
    )
    op.add_column("api_keys", is_next)
    op.create_index(
        "api_keys_ending",
        "api_keys",
        ["ends_wall_ms"],
        sqlite_where=sa.text(_ENDS),
        postgresql_where=sa.text(_ENDS),
    )
    op.create_index(
        "api_key_next",
        "api_keys",
        ["replaces_key_id"],
        unique=True,
        sqlite_where=sa.text(_IS_NEXT),
        postgresql_where=sa.text(_IS_NEXT),
    )
