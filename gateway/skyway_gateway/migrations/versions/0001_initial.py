"""The tables of the gateway."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "api_keys",
        sa.Column("key_id", sa.Text(), nullable=False),
        sa.Column("key_hash", sa.Text(), nullable=False),
        sa.Column("role", sa.Text(), nullable=False),
        sa.Column("subject_id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=True),
        sa.Column("scopes", sa.Text(), nullable=True),
        sa.Column("created_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("expires_wall_ms", sa.BigInteger(), nullable=True),
        sa.Column("ends_wall_ms", sa.BigInteger(), nullable=True),
        sa.Column("deleted_wall_ms", sa.BigInteger(), nullable=True),
        sa.Column("replaces_key_id", sa.Text(), nullable=True),
        sa.Column("is_next", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.Column("is_account_open", sa.Boolean(), nullable=False),
        sa.Column("gave_password", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.CheckConstraint("role IN ('customer', 'provider', 'operator')", name="api_key_role"),
        sa.PrimaryKeyConstraint("key_id"),
        sa.UniqueConstraint("key_hash", name="api_key_hash"),
    )
    op.create_index(
        "api_key_next",
        "api_keys",
        ["replaces_key_id"],
        unique=True,
        sqlite_where=sa.text("is_next AND deleted_wall_ms IS NULL"),
        postgresql_where=sa.text("is_next AND deleted_wall_ms IS NULL"),
    )
    op.create_index("api_keys_by_subject", "api_keys", ["role", "subject_id"], unique=False)
    op.create_index(
        "api_keys_ending",
        "api_keys",
        ["ends_wall_ms"],
        unique=False,
        sqlite_where=sa.text("deleted_wall_ms IS NULL AND ends_wall_ms IS NOT NULL"),
        postgresql_where=sa.text("deleted_wall_ms IS NULL AND ends_wall_ms IS NOT NULL"),
    )
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
        sa.Column("number", sa.BigInteger(), server_default="0", nullable=False),
        sa.Column("hash", sa.Text(), server_default=sa.text("''"), nullable=False),
        sa.Column("refused_minute", sa.BigInteger(), nullable=True),
        sa.Column("refused_source", sa.Text(), nullable=True),
        sa.PrimaryKeyConstraint("entry_id"),
    )
    op.create_index("audit_by_subject", "audit", ["role", "subject_id", "entry_id"], unique=False)
    op.create_index("audit_number", "audit", ["number"], unique=True)
    op.create_index("audit_refused", "audit", ["refused_minute", "refused_source"], unique=True)
    op.create_table(
        "audit_head",
        sa.Column("only", sa.SmallInteger(), autoincrement=False, nullable=False),
        sa.Column("entries", sa.BigInteger(), nullable=False),
        sa.Column("hash", sa.Text(), nullable=False),
        sa.Column("pruned_entries", sa.BigInteger(), server_default="0", nullable=False),
        sa.Column("pruned_hash", sa.Text(), server_default=sa.text("''"), nullable=False),
        sa.PrimaryKeyConstraint("only"),
    )
    op.create_table(
        "custody",
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("package_id", sa.Text(), nullable=False),
        sa.Column("seq", sa.Integer(), nullable=False),
        sa.Column("custodian_kind", sa.Text(), nullable=False),
        sa.Column("custodian_id", sa.Text(), nullable=False),
        sa.Column("at_ms", sa.BigInteger(), nullable=False),
        sa.CheckConstraint(
            "custodian_kind IN ('STATION', 'DRONE', 'RECIPIENT')", name="custodian_kind"
        ),
        sa.PrimaryKeyConstraint("delivery_id", "package_id", "seq"),
    )
    op.create_index(
        "custody_delivered",
        "custody",
        ["delivery_id", "package_id"],
        unique=True,
        sqlite_where=sa.text("custodian_kind = 'RECIPIENT'"),
        postgresql_where=sa.text("custodian_kind = 'RECIPIENT'"),
    )
    op.create_table(
        "deliveries",
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("customer_id", sa.Text(), nullable=False),
        sa.Column("reference", sa.Text(), nullable=True),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("activity", sa.Text(), nullable=True),
        sa.Column("is_delayed", sa.Boolean(), nullable=False),
        sa.Column("is_replanning", sa.Boolean(), nullable=False),
        sa.Column("request", sa.Text(), nullable=False),
        sa.Column("pickup_position", sa.Text(), nullable=False),
        sa.Column("created_ms", sa.BigInteger(), nullable=False),
        sa.Column("updated_ms", sa.BigInteger(), nullable=False),
        sa.Column("give_up_ms", sa.BigInteger(), nullable=False),
        sa.Column("earliest_pickup_ms", sa.BigInteger(), nullable=True),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("refusals", sa.Text(), nullable=False),
        sa.Column("reasons", sa.Text(), nullable=False),
        sa.Column("last_sequence", sa.Integer(), nullable=False),
        sa.Column("events_hash", sa.Text(), server_default=sa.text("''"), nullable=False),
        sa.Column("has_idempotency_key", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.Column("traceparent", sa.Text(), nullable=True),
        sa.Column("offer", sa.Text(), nullable=True),
        sa.Column("is_queued", sa.Boolean(), server_default=sa.true(), nullable=False),
        sa.Column("cancel_reason", sa.Text(), nullable=True),
        sa.Column("next_try_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("network_id", sa.Text(), nullable=True),
        sa.Column("queue_rank", sa.SmallInteger(), server_default="1", nullable=False),
        sa.Column("waits_since_ms", sa.BigInteger(), nullable=True),
        sa.Column("asked_wall_ms", sa.BigInteger(), nullable=True),
        sa.Column("woken_wall_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.Column("version", sa.Integer(), server_default="0", nullable=False),
        sa.Column("is_leaving", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.Column("claimed_by", sa.Text(), nullable=True),
        sa.Column("claimed_until_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.CheckConstraint(
            "state IN ('SCHEDULED', 'REQUESTED', 'PLANNED', 'DISPATCHED', 'LOADING', "
            "'IN_PROGRESS', 'COMPLETED', 'PARTIALLY_COMPLETED', 'CANCELLED', 'FAILED', "
            "'REJECTED')",
            name="delivery_state",
        ),
        sa.PrimaryKeyConstraint("delivery_id"),
    )
    op.create_index(
        "deliveries_by_customer", "deliveries", ["customer_id", "delivery_id"], unique=False
    )
    op.create_index(
        "deliveries_by_state", "deliveries", ["state", "next_try_wall_ms"], unique=False
    )
    op.create_index("deliveries_by_time", "deliveries", ["created_ms"], unique=False)
    op.create_index(
        "deliveries_live",
        "deliveries",
        ["customer_id", "state"],
        unique=False,
        sqlite_where=sa.text(
            "state IN ('SCHEDULED', 'REQUESTED', 'PLANNED', 'DISPATCHED', 'LOADING', 'IN_PROGRESS')"
        ),
        postgresql_where=sa.text(
            "state IN ('SCHEDULED', 'REQUESTED', 'PLANNED', 'DISPATCHED', 'LOADING', 'IN_PROGRESS')"
        ),
    )
    op.create_index(
        "deliveries_over",
        "deliveries",
        ["updated_ms"],
        unique=False,
        sqlite_where=sa.text(
            "(state || '') IN ('COMPLETED', 'PARTIALLY_COMPLETED', 'CANCELLED', 'FAILED', "
            "'REJECTED')"
        ),
        postgresql_where=sa.text(
            "(state || '') IN ('COMPLETED', 'PARTIALLY_COMPLETED', 'CANCELLED', 'FAILED', "
            "'REJECTED')"
        ),
    )
    op.create_index(
        "deliveries_queued", "deliveries", ["is_queued", "next_try_wall_ms"], unique=False
    )
    op.create_index(
        "deliveries_scheduled",
        "deliveries",
        ["earliest_pickup_ms"],
        unique=False,
        sqlite_where=sa.text("state = 'SCHEDULED'"),
        postgresql_where=sa.text("state = 'SCHEDULED'"),
    )
    op.create_index(
        "deliveries_waiting",
        "deliveries",
        ["network_id", "queue_rank", "created_ms", "delivery_id"],
        unique=False,
        sqlite_where=sa.text("waits_since_ms IS NOT NULL"),
        postgresql_where=sa.text("waits_since_ms IS NOT NULL"),
    )
    op.create_table(
        "idempotency",
        sa.Column("key_hash", sa.Text(), nullable=False),
        sa.Column("body_hash", sa.LargeBinary(), nullable=False),
        sa.Column("answer", sa.LargeBinary(), nullable=True),
        sa.Column("created_at_ms", sa.BigInteger(), nullable=False),
        sa.Column("location", sa.Text(), nullable=True),
        sa.PrimaryKeyConstraint("key_hash"),
    )
    op.create_index("idempotency_age", "idempotency", ["created_at_ms"], unique=False)
    op.create_table(
        "known_networks",
        sa.Column("network_id", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("stations", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("network_id"),
    )
    op.create_table(
        "outbox",
        sa.Column("id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("channel", sa.Text(), nullable=False),
        sa.Column("stream", sa.Text(), nullable=False),
        sa.Column("address", sa.Text(), nullable=False),
        sa.Column("payload", sa.LargeBinary(), nullable=False),
        sa.Column("confirmed_by", sa.Text(), nullable=False),
        sa.Column("message_id", sa.Text(), nullable=True),
        sa.Column("mqtt_qos", sa.Integer(), nullable=False),
        sa.Column("is_retained", sa.Boolean(), nullable=False),
        sa.Column("traceparent", sa.Text(), nullable=True),
        sa.Column("attempts", sa.Integer(), server_default="0", nullable=False),
        sa.Column("due_at_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.Column("stored_wall_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.Column("claimed_by", sa.Text(), nullable=True),
        sa.Column("claimed_until_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    op.create_index("outbox_message", "outbox", ["message_id"], unique=False)
    op.create_index("outbox_stream", "outbox", ["channel", "stream", "id"], unique=False)
    op.create_table(
        "pruned",
        sa.Column("table_name", sa.Text(), nullable=False),
        sa.Column("before_wall_ms", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("table_name"),
    )
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
        sa.Column("hold_id", sa.Text(), nullable=True),
        sa.PrimaryKeyConstraint("quote_id"),
    )
    op.create_index("quotes_by_expiry", "quotes", ["expires_wall_ms"], unique=False)
    op.create_index(
        "quotes_held",
        "quotes",
        ["expires_wall_ms"],
        unique=False,
        sqlite_where=sa.text("hold_id IS NOT NULL"),
        postgresql_where=sa.text("hold_id IS NOT NULL"),
    )
    op.create_table(
        "replicas",
        sa.Column("replica_id", sa.Text(), nullable=False),
        sa.Column("joined_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("seen_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("is_listening", sa.Boolean(), nullable=False),
        sa.PrimaryKeyConstraint("replica_id"),
    )
    op.create_table(
        "webhook_attempts",
        sa.Column("attempt_id", sa.Text(), nullable=False),
        sa.Column("webhook_id", sa.Text(), nullable=False),
        sa.Column("event_id", sa.Text(), nullable=False),
        sa.Column("event_type", sa.Text(), nullable=False),
        sa.Column("delivery_id", sa.Text(), nullable=True),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("at_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("duration_ms", sa.Integer(), nullable=False),
        sa.Column("outcome", sa.Text(), nullable=False),
        sa.Column("status", sa.Integer(), nullable=True),
        sa.Column("detail", sa.Text(), nullable=True),
        sa.Column("next_try_wall_ms", sa.BigInteger(), nullable=True),
        sa.CheckConstraint(
            "outcome IN ('DELIVERED', 'FAILED', 'GIVEN_UP')", name="attempt_outcome"
        ),
        sa.PrimaryKeyConstraint("attempt_id"),
    )
    op.create_index(
        "webhook_attempts_by_webhook",
        "webhook_attempts",
        ["webhook_id", "attempt_id"],
        unique=False,
    )
    op.create_table(
        "webhooks",
        sa.Column("webhook_id", sa.Text(), nullable=False),
        sa.Column("customer_id", sa.Text(), nullable=False),
        sa.Column("url", sa.Text(), nullable=False),
        sa.Column("event_types", sa.Text(), nullable=True),
        sa.Column("secret", sa.Text(), nullable=False),
        sa.Column("previous_secrets", sa.Text(), server_default=sa.text("'[]'"), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("disabled_reason", sa.Text(), nullable=True),
        sa.Column("created_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("changed_wall_ms", sa.BigInteger(), nullable=False),
        sa.CheckConstraint("state IN ('ACTIVE', 'DISABLED')", name="webhook_state"),
        sa.PrimaryKeyConstraint("webhook_id"),
    )
    op.create_index("webhooks_by_customer", "webhooks", ["customer_id", "webhook_id"], unique=False)
    op.create_table(
        "events",
        sa.Column("event_id", sa.Text(), nullable=False),
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("sequence", sa.Integer(), nullable=False),
        sa.Column("type", sa.Text(), nullable=False),
        sa.Column("body", sa.Text(), nullable=False),
        sa.Column("recorded_wall_ms", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["delivery_id"],
            ["deliveries.delivery_id"],
        ),
        sa.PrimaryKeyConstraint("event_id"),
        sa.UniqueConstraint("delivery_id", "sequence", name="event_sequence"),
    )
    op.create_table(
        "missions",
        sa.Column("mission_id", sa.Text(), nullable=False),
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("trip", sa.Integer(), nullable=False),
        sa.Column("provider_id", sa.Text(), nullable=False),
        sa.Column("drone_id", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("report_seq", sa.Integer(), nullable=False),
        sa.Column("body", sa.Text(), nullable=False),
        sa.Column("price_amount", sa.BigInteger(), nullable=True),
        sa.Column("currency", sa.Text(), nullable=True),
        sa.Column("ended_ms", sa.BigInteger(), nullable=True),
        sa.Column("start_ms", sa.BigInteger(), nullable=False),
        sa.Column("flight_s", sa.Double(), nullable=True),
        sa.Column("waiting_s", sa.Double(), nullable=True),
        sa.Column("recharging_s", sa.Double(), nullable=True),
        sa.ForeignKeyConstraint(
            ["delivery_id"],
            ["deliveries.delivery_id"],
        ),
        sa.PrimaryKeyConstraint("mission_id"),
        sa.UniqueConstraint("delivery_id", "attempt", "trip", name="mission_attempt"),
    )
    op.create_index("missions_by_end", "missions", ["provider_id", "ended_ms"], unique=False)
    op.create_index(
        "missions_by_provider", "missions", ["provider_id", "delivery_id"], unique=False
    )
    op.create_table(
        "packages",
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("package_id", sa.Text(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("destination_station_id", sa.Text(), nullable=False),
        sa.Column("mass_kg", sa.Double(), nullable=False),
        sa.Column("custodian_kind", sa.Text(), nullable=False),
        sa.Column("custodian_id", sa.Text(), nullable=False),
        sa.Column("custody_seq", sa.Integer(), nullable=False),
        sa.Column("promised_ms", sa.BigInteger(), nullable=True),
        sa.Column("promised_p90_ms", sa.BigInteger(), nullable=True),
        sa.Column("due_ms", sa.BigInteger(), nullable=True),
        sa.Column("eta_ms", sa.BigInteger(), nullable=True),
        sa.Column("delivered_ms", sa.BigInteger(), nullable=True),
        sa.Column("mission_id", sa.Text(), nullable=True),
        sa.Column("code", sa.Text(), nullable=True),
        sa.Column("detail", sa.Text(), nullable=True),
        sa.Column("proof", sa.Text(), nullable=True),
        sa.Column("position", sa.Text(), nullable=True),
        sa.CheckConstraint(
            "state IN ('CREATED', 'LOADED', 'IN_TRANSIT', 'DELIVERED', 'RETURNING', 'RETURNED', "
            "'STRANDED', 'CANCELLED')",
            name="package_state",
        ),
        sa.ForeignKeyConstraint(
            ["delivery_id"],
            ["deliveries.delivery_id"],
        ),
        sa.PrimaryKeyConstraint("delivery_id", "package_id"),
    )
    op.create_index(
        "packages_delivered",
        "packages",
        ["delivered_ms"],
        unique=False,
        sqlite_where=sa.text("delivered_ms IS NOT NULL"),
        postgresql_where=sa.text("delivered_ms IS NOT NULL"),
    )
    op.create_table(
        "session_links",
        sa.Column("code_hash", sa.Text(), nullable=False),
        sa.Column("key_id", sa.Text(), nullable=False),
        sa.Column("expires_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("used_wall_ms", sa.BigInteger(), nullable=True),
        sa.CheckConstraint("used_wall_ms <= expires_wall_ms", name="session_link_used"),
        sa.ForeignKeyConstraint(
            ["key_id"],
            ["api_keys.key_id"],
        ),
        sa.PrimaryKeyConstraint("code_hash"),
    )
    op.create_index("session_links_by_expiry", "session_links", ["expires_wall_ms"], unique=False)
    op.create_index(
        "session_links_by_key", "session_links", ["key_id", "expires_wall_ms"], unique=False
    )
    op.create_table(
        "sessions",
        sa.Column("session_hash", sa.Text(), nullable=False),
        sa.Column("key_id", sa.Text(), nullable=False),
        sa.Column("expires_wall_ms", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["key_id"],
            ["api_keys.key_id"],
        ),
        sa.PrimaryKeyConstraint("session_hash"),
    )
    op.create_index("sessions_by_expiry", "sessions", ["expires_wall_ms"], unique=False)
    op.create_index("sessions_by_key", "sessions", ["key_id", "expires_wall_ms"], unique=False)
    op.create_table(
        "tracking_links",
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("is_withdrawn", sa.Boolean(), nullable=False),
        sa.CheckConstraint("number >= 1", name="tracking_link_number"),
        sa.ForeignKeyConstraint(
            ["delivery_id"],
            ["deliveries.delivery_id"],
        ),
        sa.PrimaryKeyConstraint("delivery_id"),
    )
    op.create_table(
        "notifications",
        sa.Column("webhook_id", sa.Text(), nullable=False),
        sa.Column("event_id", sa.Text(), nullable=False),
        sa.Column("delivery_id", sa.Text(), nullable=False),
        sa.Column("sequence", sa.Integer(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("next_try_wall_ms", sa.BigInteger(), nullable=False),
        sa.Column("is_replay", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.Column("claimed_by", sa.Text(), nullable=True),
        sa.Column("claimed_until_ms", sa.BigInteger(), server_default="0", nullable=False),
        sa.CheckConstraint(
            "state IN ('PENDING', 'DELIVERED', 'GIVEN_UP')", name="notification_state"
        ),
        sa.ForeignKeyConstraint(
            ["event_id"],
            ["events.event_id"],
        ),
        sa.PrimaryKeyConstraint("webhook_id", "event_id"),
    )
    op.create_index("notifications_by_event", "notifications", ["event_id"], unique=False)
    op.create_index(
        "notifications_pending",
        "notifications",
        ["webhook_id", "delivery_id", "sequence"],
        unique=False,
        sqlite_where=sa.text("state = 'PENDING'"),
        postgresql_where=sa.text("state = 'PENDING'"),
    )
    # The audit log begins without entries.
    op.execute(
        'INSERT INTO audit_head ("only", entries, hash, pruned_entries, pruned_hash) '
        "VALUES (1, 0, '', 0, '')"
    )
