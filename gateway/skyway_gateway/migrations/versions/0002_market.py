"""Quotes, deliveries of several trips, proof, and the audit log."""

import json

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
    _widen_packages()
    _widen_missions()
    op.add_column(
        "notifications",
        sa.Column("is_replay", sa.Boolean(), server_default=sa.false(), nullable=False),
    )
    _create_quotes()
    _create_audit()


def _widen_packages() -> None:
    for name in ("mission_id", "code", "detail", "proof"):
        op.add_column("packages", sa.Column(name, sa.Text(), nullable=True))
    # Before this version a delivery had one mission at a time, for all its packages.
    op.execute(
        "UPDATE packages SET mission_id = (SELECT mission_id FROM missions"
        " WHERE missions.delivery_id = packages.delivery_id AND missions.state <> 'REFUSED'"
        " ORDER BY attempt DESC LIMIT 1)"
    )


def _widen_missions() -> None:
    for column in (
        sa.Column("start_ms", sa.BigInteger(), nullable=True),
        sa.Column("flight_s", sa.Double(), nullable=True),
        sa.Column("waiting_s", sa.Double(), nullable=True),
        sa.Column("recharging_s", sa.Double(), nullable=True),
        # What a provider earns is added up by the database, so it must see price and end.
        sa.Column("price_amount", sa.BigInteger(), nullable=True),
        sa.Column("currency", sa.Text(), nullable=True),
        sa.Column("ended_ms", sa.BigInteger(), nullable=True),
    ):
        op.add_column("missions", column)
    op.create_index("missions_by_end", "missions", ["provider_id", "ended_ms"])
    _fill_in_prices()


def _fill_in_prices() -> None:
    missions = sa.table(
        "missions",
        *map(sa.column, ("mission_id", "body", "price_amount", "currency")),
    )
    connection = op.get_bind()
    for row in connection.execute(sa.select(missions.c.mission_id, missions.c.body)).all():
        price = json.loads(row.body)["price"]
        values = {"price_amount": price["amount"], "currency": price["currency"]}
        this = missions.c.mission_id == row.mission_id
        connection.execute(missions.update().where(this).values(values))
    # When they ended was not kept; the last change of their delivery is close to it.
    op.execute(
        "UPDATE missions SET ended_ms = (SELECT updated_ms FROM deliveries"
        " WHERE deliveries.delivery_id = missions.delivery_id)"
        " WHERE state IN ('COMPLETED', 'ABORTED', 'CANCELLED')"
    )


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
