"""Which key gave a broker account its present password: the newest key of the account's holder.

Where the newest key has ended, no key is marked: the account stays until its last key ends, or a
new key gives it another password.
"""

import sqlalchemy as sa
from alembic import op

revision = "0018"
down_revision = "0017"
branch_labels = None
depends_on = None

_MARK_NEWEST = """
UPDATE api_keys SET gave_password = true
WHERE deleted_wall_ms IS NULL AND is_account_open AND replaces_key_id IS NULL
  AND (scopes IS NULL OR (role = 'customer' AND scopes LIKE '%"deliveries:read"%'))
  AND role IN ('customer', 'operator')
  AND NOT EXISTS (
    SELECT 1 FROM api_keys AS newer
    WHERE newer.role = api_keys.role AND newer.subject_id = api_keys.subject_id
      AND newer.is_account_open AND newer.replaces_key_id IS NULL
      AND (newer.scopes IS NULL OR (
        newer.role = 'customer' AND newer.scopes LIKE '%"deliveries:read"%'))
      AND (newer.created_wall_ms > api_keys.created_wall_ms
        OR (newer.created_wall_ms = api_keys.created_wall_ms AND newer.key_id > api_keys.key_id))
  )
"""


def upgrade() -> None:
    gave: sa.Column[bool] = sa.Column(
        "gave_password", sa.Boolean(), nullable=False, server_default=sa.false()
    )
    op.add_column("api_keys", gave)
    op.execute(_MARK_NEWEST)
