"""Webhooks whose secrets are rotated.

The service encrypts the secrets at its start: a migration does not know the key.
"""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None


def upgrade() -> None:
    none = sa.text("'[]'")
    previous: sa.Column[str] = sa.Column(
        "previous_secrets", sa.Text(), nullable=False, server_default=none
    )
    op.add_column("webhooks", previous)
