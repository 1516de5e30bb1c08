"""The tables of packages: who holds each, and what was cancelled."""

from sqlalchemy import (
    BigInteger,
    CheckConstraint,
    Column,
    ForeignKey,
    Index,
    Integer,
    Table,
    Text,
    text,
)

from skyway_composition.tables.metadata import metadata

#: Who holds a package, from the pickup station to the recipient: rows are only added.
custody = Table(
    "custody",
    metadata,
    Column("delivery_id", Text, primary_key=True),
    Column("package_id", Text, primary_key=True),
    Column("seq", Integer, primary_key=True),
    Column("custodian_kind", Text, nullable=False),
    Column("custodian_id", Text, nullable=False),
    Column("mission_id", Text, ForeignKey("missions.mission_id"), nullable=False),
    Column("at_ms", BigInteger, nullable=False),
    CheckConstraint("custodian_kind IN ('STATION', 'DRONE', 'RECIPIENT')", name="custodian_kind"),
    # I6: delivered once.
    Index(
        "custody_delivered",
        "delivery_id",
        "package_id",
        unique=True,
        sqlite_where=text("custodian_kind = 'RECIPIENT'"),
        postgresql_where=text("custodian_kind = 'RECIPIENT'"),
    ),
)

#: What was cancelled, and what that was answered with: asked again, it is answered the same.
cancellations = Table(
    "cancellations",
    metadata,
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), primary_key=True),
    Column("cancellation_id", Text, primary_key=True),
    Column("answer", Text, nullable=False),  # JSON of skyway.contracts.mission.Cancellation
    Column("at_ms", BigInteger, nullable=False),
)
