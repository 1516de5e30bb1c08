"""The table of remembered answers."""

from sqlalchemy import BigInteger, Column, Index, LargeBinary, MetaData, Table, Text


def idempotency_table(metadata: MetaData) -> Table:
    """The table of remembered answers."""
    return Table(
        "idempotency",
        metadata,
        Column("key_hash", Text, primary_key=True),
        Column("body_hash", LargeBinary, nullable=False),
        Column("answer", LargeBinary),
        Column("created_at_ms", BigInteger, nullable=False),
        Index("idempotency_age", "created_at_ms"),
    )
