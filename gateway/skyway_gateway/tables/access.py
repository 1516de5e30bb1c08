"""Who may call, and what they changed."""

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Index,
    Integer,
    Table,
    Text,
    UniqueConstraint,
)

from skyway_gateway.tables.metadata import metadata

#: Of a key only its hash is kept; a deleted one stays, so that a restart does not revive it.
api_keys = Table(
    "api_keys",
    metadata,
    Column("key_id", Text, primary_key=True),
    Column("key_hash", Text, nullable=False),
    Column("role", Text, nullable=False),
    Column("subject_id", Text, nullable=False),
    Column("created_wall_ms", BigInteger, nullable=False),
    Column("deleted_wall_ms", BigInteger),
    # Whether the registry has the broker account that was handed out with the key.
    Column("is_account_open", Boolean, nullable=False),
    UniqueConstraint("key_hash", name="api_key_hash"),
    CheckConstraint("role IN ('customer', 'provider', 'operator')", name="api_key_role"),
    Index("api_keys_by_subject", "role", "subject_id"),
)

#: What operators and providers changed: one row per call that was answered.
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
    Index("audit_by_subject", "role", "subject_id", "entry_id"),
)
