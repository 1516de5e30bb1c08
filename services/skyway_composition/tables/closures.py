"""The table of closures."""

from sqlalchemy import BigInteger, CheckConstraint, Column, ForeignKey, Index, Integer, Table, Text

from skyway_composition.tables.metadata import metadata

#: What happens in the world, from `from_ms` until it ends or is lifted: rows are never deleted.
closures = Table(
    "closures",
    metadata,
    Column("closure_id", Text, primary_key=True),
    Column("kind", Text, nullable=False),
    Column("network_id", Text, ForeignKey("networks.network_id")),  # null: ground stop everywhere
    Column("station_id", Text),
    Column("pad", Integer),
    Column("to_station_id", Text),
    Column("area", Text),  # JSON of a GeoJSON polygon
    Column("provider_id", Text),
    Column("drone_model_id", Text),
    Column("reason", Text),
    Column("from_ms", BigInteger, nullable=False),
    Column("until_ms", BigInteger),
    Column("made_ms", BigInteger, nullable=False),
    Column("lifted_ms", BigInteger),
    CheckConstraint(
        "kind IN ('STATION', 'PAD', 'SEGMENT', 'ZONE', 'GROUND_STOP')", name="closure_kind"
    ),
    CheckConstraint("until_ms IS NULL OR from_ms < until_ms", name="closure_lasts"),
    Index("closures_in_force", "network_id", "lifted_ms", "until_ms"),
    Index("closures_by_station", "station_id"),
)
