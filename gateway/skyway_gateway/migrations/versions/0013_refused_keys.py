"""Refused keys in the audit log, once in each minute."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("audit", sa.Column("refused_minute", sa.BigInteger(), nullable=True))
    op.add_column("audit", sa.Column("refused_source", sa.Text(), nullable=True))
    op.create_index("audit_refused", "audit", ["refused_minute", "refused_source"], unique=True)
