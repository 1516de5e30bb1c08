"""Delivery events, webhooks, and each event on its way to each webhook."""

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    ForeignKey,
    Index,
    Integer,
    Table,
    Text,
    UniqueConstraint,
    false,
    text,
)

from skyway.runtime.sql.claims import claim_columns
from skyway_gateway.tables.metadata import metadata

events = Table(
    "events",
    metadata,
    Column("event_id", Text, primary_key=True),
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), nullable=False),
    Column("sequence", Integer, nullable=False),
    Column("type", Text, nullable=False),
    Column("body", Text, nullable=False),  # JSON of DeliveryEvent, as every channel carries it
    Column("recorded_wall_ms", BigInteger, nullable=False),
    UniqueConstraint("delivery_id", "sequence", name="event_sequence"),
)

webhooks = Table(
    "webhooks",
    metadata,
    Column("webhook_id", Text, primary_key=True),
    Column("customer_id", Text, nullable=False),
    Column("url", Text, nullable=False),
    Column("event_types", Text),  # JSON list; null means all
    Column("secret", Text, nullable=False),
    Column("state", Text, nullable=False),
    Column("disabled_reason", Text),
    Column("created_wall_ms", BigInteger, nullable=False),
    Column("changed_wall_ms", BigInteger, nullable=False),
    CheckConstraint("state IN ('ACTIVE', 'DISABLED')", name="webhook_state"),
    Index("webhooks_by_customer", "customer_id", "webhook_id"),
)

#: One event on its way to one webhook, written in the event's transaction.
notifications = Table(
    "notifications",
    metadata,
    # No foreign key: a webhook may be deleted while an event is recorded.
    Column("webhook_id", Text, primary_key=True),
    Column("event_id", Text, ForeignKey("events.event_id"), primary_key=True),
    Column("delivery_id", Text, nullable=False),
    Column("sequence", Integer, nullable=False),
    Column("state", Text, nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("next_try_wall_ms", BigInteger, nullable=False),
    # A replay that the customer asked for comes after later events.
    Column("is_replay", Boolean, nullable=False, server_default=false()),
    *claim_columns(),
    CheckConstraint("state IN ('PENDING', 'DELIVERED', 'GIVEN_UP')", name="notification_state"),
    Index(
        "notifications_pending",
        "webhook_id",
        "delivery_id",
        "sequence",
        sqlite_where=text("state = 'PENDING'"),
        postgresql_where=text("state = 'PENDING'"),
    ),
)

#: Each attempt to notify a webhook; `event_id` is its webhook-id.
webhook_attempts = Table(
    "webhook_attempts",
    metadata,
    Column("attempt_id", Text, primary_key=True),
    Column("webhook_id", Text, nullable=False),
    Column("event_id", Text, nullable=False),
    Column("event_type", Text, nullable=False),
    Column("delivery_id", Text),
    Column("number", Integer, nullable=False),
    Column("at_wall_ms", BigInteger, nullable=False),
    Column("duration_ms", Integer, nullable=False),
    Column("outcome", Text, nullable=False),
    Column("status", Integer),
    Column("detail", Text),
    Column("next_try_wall_ms", BigInteger),
    CheckConstraint("outcome IN ('DELIVERED', 'FAILED', 'GIVEN_UP')", name="attempt_outcome"),
    Index("webhook_attempts_by_webhook", "webhook_id", "attempt_id"),
)
