"""The table of messages on their way."""

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
)

from skyway.runtime.sql.claims import claim_columns


def outbox_table(metadata: MetaData) -> Table:
    """The table of messages on their way; `channel` is ``mqtt`` or the name of a service."""
    return Table(
        "outbox",
        metadata,
        # Never reused, so that a late answer cannot delete another row.
        Column("id", BigInteger().with_variant(Integer, "sqlite"), primary_key=True),
        Column("channel", Text, nullable=False),
        Column("stream", Text, nullable=False),
        Column("address", Text, nullable=False),
        Column("payload", LargeBinary, nullable=False),
        Column("confirmed_by", Text, nullable=False),
        Column("message_id", Text),
        Column("mqtt_qos", Integer, nullable=False),
        Column("is_retained", Boolean, nullable=False),
        Column("traceparent", Text),
        Column("attempts", Integer, nullable=False, server_default="0"),
        Column("due_at_ms", BigInteger, nullable=False, server_default="0"),
        *claim_columns(),
        Index("outbox_stream", "channel", "stream", "id"),
        Index("outbox_message", "message_id"),
        sqlite_autoincrement=True,
    )
