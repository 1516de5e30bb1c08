"""Tokens with which drones enrol, their keys, and accounts that are revoked."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("broker_accounts", sa.Column("revoked_wall_ms", sa.BigInteger()))
    op.create_table(
        "enrolment_tokens",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("token_hash", sa.Text(), nullable=False),
        sa.Column("expires_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("used_wall_ms", sa.BigInteger()),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
        sa.UniqueConstraint("token_hash", name="enrolment_token_hash"),
    )
    op.create_table(
        "drone_keys",
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("key_hash", sa.Text(), nullable=False),
        sa.Column("next_key_hash", sa.Text()),
        sa.Column("next_password_hash", sa.Text()),
        sa.ForeignKeyConstraint(["drone_id"], ["drones.drone_id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("drone_id"),
        sa.UniqueConstraint("key_hash", name="drone_key_hash"),
        sa.UniqueConstraint("next_key_hash", name="drone_next_key_hash"),
    )
