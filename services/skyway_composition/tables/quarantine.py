"""The table of the messages that were set aside."""

from sqlalchemy import BigInteger, Column, Index, LargeBinary, Table, Text, UniqueConstraint

from skyway_composition.tables.networks import metadata

#: The messages of drones that were not taken, each once however often it came.
quarantine = Table(
    "quarantine",
    metadata,
    Column("quarantine_id", Text, primary_key=True),
    Column("topic", Text, nullable=False),
    Column("provider_id", Text, nullable=False),
    Column("drone_id", Text, nullable=False),
    Column("reason", Text, nullable=False),
    Column("detail", Text, nullable=False),
    Column("payload", LargeBinary, nullable=False),  # the first bytes of it
    Column("payload_sha256", Text, nullable=False),  # of the whole payload
    Column("size_bytes", BigInteger, nullable=False),  # of the whole payload
    Column("times", BigInteger, nullable=False),
    Column("first_ms", BigInteger, nullable=False),
    Column("last_ms", BigInteger, nullable=False),
    Column("last_wall_ms", BigInteger, nullable=False),
    UniqueConstraint("topic", "payload_sha256", name="quarantine_once"),
    Index("quarantine_by_provider", "provider_id", "drone_id"),
)
