"""API keys and the audit log."""

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Index,
    Integer,
    SmallInteger,
    Table,
    Text,
    UniqueConstraint,
    text,
)

from skyway_gateway.tables.metadata import metadata

#: Only the hash of a key is stored. Deleted keys stay, so that a restart does not add them again.
api_keys = Table(
    "api_keys",
    metadata,
    Column("key_id", Text, primary_key=True),
    Column("key_hash", Text, nullable=False),
    Column("role", Text, nullable=False),
    Column("subject_id", Text, nullable=False),
    Column("created_wall_ms", BigInteger, nullable=False),
    Column("deleted_wall_ms", BigInteger),
    # Whether the registry has the broker account that was issued with the key.
    Column("is_account_open", Boolean, nullable=False),
    UniqueConstraint("key_hash", name="api_key_hash"),
    CheckConstraint("role IN ('customer', 'provider', 'operator')", name="api_key_role"),
    Index("api_keys_by_subject", "role", "subject_id"),
)

#: The calls of operators and providers: one row for each answered call. Rows are only added.
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
    # Of this entry and all entries before it, as `audit.store.entry_hash` chains them.
    Column("hash", Text, nullable=False, server_default=text("''")),
    Index("audit_number", "number", unique=True),
    Index("audit_by_subject", "role", "subject_id", "entry_id"),
)

#: One row: how many entries the audit log has, and the hash of the last one.
audit_head = Table(
    "audit_head",
    metadata,
    Column("only", SmallInteger, primary_key=True, autoincrement=False),
    Column("entries", BigInteger, nullable=False),
    Column("hash", Text, nullable=False),
)
