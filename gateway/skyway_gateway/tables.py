"""The tables of the gateway; `_ms` is fleet time, `_wall_ms` wall time, in ms since 1970.

`delivery_tables` has the tables of deliveries.
"""

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    ForeignKey,
    Index,
    Integer,
    SmallInteger,
    Table,
    Text,
    UniqueConstraint,
    false,
    text,
)

from skyway.runtime.idempotency_store import idempotency_table
from skyway.runtime.outbox.outbox_store import outbox_table
from skyway.runtime.replicas.replica_store import replicas_table
from skyway.runtime.sql.claims import claim_columns
from skyway.runtime.sql.partial_index import partial_index
from skyway_gateway import delivery_tables

#: All tables of the gateway, for migrations and verification.
metadata = delivery_tables.metadata

outbox = outbox_table(metadata)
idempotency = idempotency_table(metadata)
replicas = replicas_table(metadata)

#: Only the hash of a key is stored. Deleted keys stay, so that a restart does not add them again.
api_keys = Table(
    "api_keys",
    metadata,
    Column("key_id", Text, primary_key=True),
    Column("key_hash", Text, nullable=False),
    Column("role", Text, nullable=False),
    Column("subject_id", Text, nullable=False),
    Column("name", Text),
    Column("scopes", Text),  # JSON list; null means all of the role
    Column("created_wall_ms", BigInteger, nullable=False),
    # As it was issued; null means never.
    Column("expires_wall_ms", BigInteger),
    # Not after `expires_wall_ms`; a rotation brings it near.
    Column("ends_wall_ms", BigInteger),
    Column("deleted_wall_ms", BigInteger),
    # The key from which it was rotated, which ends when this one is first used.
    Column("replaces_key_id", Text),
    # Whether this has not happened yet.
    Column("is_next", Boolean, nullable=False, server_default=false()),
    # Whether the registry has the broker account that was issued with the key.
    Column("is_account_open", Boolean, nullable=False),
    # Whether this account has the password that was issued with the key.
    Column("gave_password", Boolean, nullable=False, server_default=false()),
    UniqueConstraint("key_hash", name="api_key_hash"),
    CheckConstraint("role IN ('customer', 'provider', 'operator')", name="api_key_role"),
    Index("api_keys_by_subject", "role", "subject_id"),
    partial_index(
        "api_keys_ending",
        "ends_wall_ms",
        where="deleted_wall_ms IS NULL AND ends_wall_ms IS NOT NULL",
    ),
    # A key has at most one next key.
    partial_index(
        "api_key_next", "replaces_key_id", unique=True, where="is_next AND deleted_wall_ms IS NULL"
    ),
)

#: The calls of operators and providers: one row for each answered call; and some calls with refused
#: keys. Rows are added at the end, and only the oldest are deleted.
audit = Table(
    "audit",
    metadata,
    Column("entry_id", Text, primary_key=True),
    Column("at_ms", BigInteger, nullable=False),
    Column("at_wall_ms", BigInteger, nullable=False),
    Column("role", Text, nullable=False),
    Column("subject_id", Text, nullable=False),
    Column("method", Text, nullable=False),
    Column("path", Text, nullable=False),
    Column("status", Integer, nullable=False),
    Column("body", Text),  # JSON as it came, without secrets, cut where it is long
    Column("traceparent", Text),
    # Counts the entries from 1, without gaps.
    Column("number", BigInteger, nullable=False, server_default="0"),
    # Of this entry and all entries before it, as `audit_store.entry_hash` chains them.
    Column("hash", Text, nullable=False, server_default=text("''")),
    # Of a refused key: the minute of wall time, and the key or the address. Once in each minute.
    Column("refused_minute", BigInteger),
    Column("refused_source", Text),
    Index("audit_number", "number", unique=True),
    Index("audit_refused", "refused_minute", "refused_source", unique=True),
    Index("audit_by_subject", "role", "subject_id", "entry_id"),
)

#: One row: how many entries were ever added to the audit log, and the hash of the last one. Of the
#: entries that were deleted because of their age: how many, and the hash of the last one.
audit_head = Table(
    "audit_head",
    metadata,
    Column("only", SmallInteger, primary_key=True, autoincrement=False),
    Column("entries", BigInteger, nullable=False),
    Column("hash", Text, nullable=False),
    Column("pruned_entries", BigInteger, nullable=False, server_default="0"),
    Column("pruned_hash", Text, nullable=False, server_default=text("''")),
)

#: Offers to customers, which reserve nothing unless they are held.
quotes = Table(
    "quotes",
    metadata,
    Column("quote_id", Text, primary_key=True),
    Column("customer_id", Text, nullable=False),
    Column("request", Text, nullable=False),  # JSON of skyway.delivery.request.DeliveryRequest
    # JSON list of places.served.ServedPlace: personal data, deleted with the quote
    Column("places", Text, nullable=False),
    Column("offers", Text, nullable=False),  # JSON list of quotes.store.Offer
    Column("infeasible", Text, nullable=False),  # JSON list of ProviderReason
    Column("made_ms", BigInteger, nullable=False),
    Column("expires_wall_ms", BigInteger, nullable=False),
    Column("taken_offer_id", Text),
    Column("delivery_id", Text),
    # What composition holds for its first offers until they expire; null if nothing is held.
    Column("hold_id", Text),
    Index("quotes_by_expiry", "expires_wall_ms"),
    partial_index("quotes_taken", "delivery_id", where="delivery_id IS NOT NULL"),
    partial_index("quotes_held", "expires_wall_ms", where="hold_id IS NOT NULL"),
)

#: The last known version of each network, for the time in which composition is away.
known_networks = Table(
    "known_networks",
    metadata,
    Column("network_id", Text, primary_key=True),
    Column("version", Integer, nullable=False),
    Column("stations", Text, nullable=False),  # JSON of contracts.station_check.NetworkStations
)

events = Table(
    "events",
    metadata,
    Column("event_id", Text, primary_key=True),
    # Null for `statement.closed`, which is about a month.
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id")),
    Column("sequence", Integer, nullable=False),
    Column("type", Text, nullable=False),
    # JSON of DeliveryEvent or StatementClosed, as every channel carries it.
    Column("body", Text, nullable=False),
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
    # Encrypted, as `notifications.secret_vault` says.
    Column("secret", Text, nullable=False),
    # JSON list of secret_store.PreviousSecret: those that rotations have replaced.
    Column("previous_secrets", Text, nullable=False, server_default=text("'[]'")),
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
    Column("delivery_id", Text),
    Column("sequence", Integer, nullable=False),
    Column("state", Text, nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("next_try_wall_ms", BigInteger, nullable=False),
    # A replay that the customer asked for comes after later events.
    Column("is_replay", Boolean, nullable=False, server_default=false()),
    *claim_columns(),
    CheckConstraint("state IN ('PENDING', 'DELIVERED', 'GIVEN_UP')", name="notification_state"),
    partial_index(
        "notifications_pending", "webhook_id", "delivery_id", "sequence", where="state = 'PENDING'"
    ),
    # An event that is deleted must have no notification any more.
    Index("notifications_by_event", "event_id"),
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

#: Sessions of browsers: each stands for a key until it expires.
sessions = Table(
    "sessions",
    metadata,
    Column("session_hash", Text, primary_key=True),
    Column("key_id", Text, ForeignKey("api_keys.key_id"), nullable=False),
    Column("expires_wall_ms", BigInteger, nullable=False),
    Index("sessions_by_key", "key_id", "expires_wall_ms"),
    Index("sessions_by_expiry", "expires_wall_ms"),
)

#: Links that log a browser in once: each stands for a key until it is used or expires.
session_links = Table(
    "session_links",
    metadata,
    Column("code_hash", Text, primary_key=True),
    Column("key_id", Text, ForeignKey("api_keys.key_id"), nullable=False),
    Column("expires_wall_ms", BigInteger, nullable=False),
    Column("used_wall_ms", BigInteger),
    CheckConstraint("used_wall_ms <= expires_wall_ms", name="session_link_used"),
    Index("session_links_by_key", "key_id", "expires_wall_ms"),
    Index("session_links_by_expiry", "expires_wall_ms"),
)

#: Tracking links that were renewed or withdrawn; all other deliveries have their first link.
tracking_links = Table(
    "tracking_links",
    metadata,
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), primary_key=True),
    Column("number", Integer, nullable=False),
    Column("is_withdrawn", Boolean, nullable=False),
    CheckConstraint("number >= 1", name="tracking_link_number"),
)

#: How the tracking pages of a customer look.
brandings = Table(
    "brandings",
    metadata,
    Column("customer_id", Text, primary_key=True),
    Column("name", Text),
    Column("colour", Text),
)

#: What customers say about the people of their deliveries; no other table has any of it. A row
#: has either its details, or the moment of their erasure.
personal_data = Table(
    "personal_data",
    metadata,
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), primary_key=True),
    Column("details", Text),  # JSON of personal_data.details.PersonalData; null once erased
    # When they are erased if the delivery ends the moment it is created; as much later as it ends
    # later. So a change of the setting does not change what was promised before.
    Column("due_ms", BigInteger, nullable=False),
    Column("erased_ms", BigInteger),
    CheckConstraint("(details IS NULL) = (erased_ms IS NOT NULL)", name="personal_data_erased"),
    partial_index("personal_data_due", "due_ms", where="details IS NOT NULL"),
)

#: The lines of what customers pay and providers get, in minor units of the currency. Rows are only
#: added: by the write that settles a mission's packages, and by an operator's corrections. They
#: outlive their delivery.
ledger = Table(
    "ledger",
    metadata,
    Column("mission_id", Text, primary_key=True),
    Column("number", Integer, primary_key=True),  # within its mission, from 1
    Column("delivery_id", Text, nullable=False),
    Column("customer_id", Text, nullable=False),
    Column("provider_id", Text, nullable=False),
    Column("kind", Text, nullable=False),
    Column("amount", BigInteger, nullable=False),  # negative if the customer gets it back
    Column("currency", Text, nullable=False),
    Column("note", Text),  # why an operator corrects
    Column("at_ms", BigInteger, nullable=False),  # when the line was written
    Column("month", Text, nullable=False),  # of `at_ms`, as 2026-03
    CheckConstraint("number >= 1", name="ledger_number"),
    Index("ledger_by_customer", "month", "customer_id"),
    Index("ledger_by_provider", "provider_id", "month"),
)

#: The months whose ledger never changes any more.
closed_months = Table(
    "closed_months",
    metadata,
    Column("month", Text, primary_key=True),
    Column("closed_ms", BigInteger, nullable=False),
)

#: The sum of a customer's or a provider's lines in a closed month, as it was closed.
closed_totals = Table(
    "closed_totals",
    metadata,
    Column("month", Text, ForeignKey("closed_months.month"), primary_key=True),
    Column("role", Text, primary_key=True),
    Column("party_id", Text, primary_key=True),
    Column("currency", Text, primary_key=True),
    Column("amount", BigInteger, nullable=False),
    Column("lines", Integer, nullable=False),
    CheckConstraint("role IN ('customer', 'provider')", name="closed_total_role"),
)

#: The missions of test deliveries, which no composition knows, and their reports in order, of which
#: the first `played` have happened.
sandbox_missions = Table(
    "sandbox_missions",
    metadata,
    Column("mission_id", Text, primary_key=True),
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("mission", Text, nullable=False),  # JSON of skyway.contracts.mission.Mission
    Column("reports", Text, nullable=False),  # JSON list of MissionReport
    Column("played", Integer, nullable=False),
    Column("next_wall_ms", BigInteger),  # when the next one is due; null once all are applied
    CheckConstraint("played >= 0", name="sandbox_played"),
    UniqueConstraint("delivery_id", "attempt", name="sandbox_attempt"),
    partial_index("sandbox_due", "next_wall_ms", where="next_wall_ms IS NOT NULL"),
)

#: Up to which age the rows of a table were deleted. A table without a row here still has all.
pruned = Table(
    "pruned",
    metadata,
    Column("table_name", Text, primary_key=True),
    Column("before_wall_ms", BigInteger, nullable=False),
)
