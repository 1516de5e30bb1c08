"""Quotes, deliveries of several trips, proof, and the audit log."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    for column in (
        sa.Column("offer", sa.Text(), nullable=True),
        sa.Column("is_queued", sa.Boolean(), server_default=sa.true(), nullable=False),
        sa.Column("cancel_reason", sa.Text(), nullable=True),
    ):
        op.add_column("deliveries", column)
    op.execute("UPDATE deliveries SET is_queued = (state = 'REQUESTED')")
    op.create_index("deliveries_queued", "deliveries", ["is_queued", "next_try_wall_ms"])
    op.create_index("deliveries_by_time", "deliveries", ["created_ms"])
    op.add_column("packages", sa.Column("mission_id", sa.Text(), nullable=True))
    op.add_column("packages", sa.Column("proof", sa.Text(), nullable=True))
    op.add_column("missions", sa.Column("start_ms", sa.BigInteger(), nullable=True))
    for name in ("flight_s", "waiting_s", "recharging_s"):
        op.add_column("missions", sa.Column(name, sa.Double(), nullable=True))
    op.add_column(
        "notifications",
        sa.Column("is_replay", sa.Boolean(), server_default=sa.false(), nullable=False),
    )
    _create_quotes()
    _create_audit()


def _create_quotes() -> None:
    op.create_table(
        "quotes",
        sa.Column("quote_id", sa.Text(), nullable=False),
        sa.Column("customer_id", sa.Text(), nullable=False),
        sa.Column("request", sa.Text(), nullable=False),
        sa.Column("offers", sa.Text(), nullable=False),
        sa.Column("infeasible", sa.Text(), nullable=False),
        sa.Column("made_ms", sa.BigInteger(), nullable=False),
        sa.Column("expires_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("taken_offer_id", sa.Text(), nullable=True),
        sa.Column("delivery_id", sa.Text(), nullable=True),
        sa.PrimaryKeyConstraint("quote_id"),
    )
    op.create_index("quotes_by_expiry", "quotes", ["expires_wall_ms"])


def _create_audit() -> None:
    op.create_table(
        "audit",
        sa.Column("entry_id", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), nullable=False),
        sa.Column("at_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("role", sa.Text(), nullable=False),
        sa.Column("subject_id", sa.Text(), nullable=False),
        sa.Column("method", sa.Text(), nullable=False),
        sa.Column("path", sa.Text(), nullable=False),
        sa.Column("status", sa.Integer(), nullable=False),
        sa.Column("body", sa.Text(), nullable=True),
        sa.Column("traceparent", sa.Text(), nullable=True),
        sa.PrimaryKeyConstraint("entry_id"),
    )
    op.create_index("audit_by_subject", "audit", ["role", "subject_id", "entry_id"])
