"""The tables of networks, their versions, stations, reserved pads, closures and forecasts."""

from sqlalchemy import (
    BigInteger,
    CheckConstraint,
    Column,
    Double,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
)

from skyway.runtime.sql.partial_index import partial_index

#: All tables of composition.
metadata = MetaData()

#: The current version of each network.
networks = Table(
    "networks",
    metadata,
    Column("network_id", Text, primary_key=True),
    Column("version", Integer, nullable=False),
    Column("sha256", Text, nullable=False),
    Column("published_ms", BigInteger, nullable=False),
    # Its content is kept from this version on; older versions were deleted by their age.
    Column("oldest_version", Integer, nullable=False, server_default="1"),
    # Changes with every closure, zone, outage and ground stop that is made or lifted, and with
    # every forecast (I11).
    Column("conditions", BigInteger, nullable=False, server_default="0"),
)

network_versions = Table(
    "network_versions",
    metadata,
    Column("network_id", Text, ForeignKey("networks.network_id"), primary_key=True),
    Column("version", Integer, primary_key=True),
    Column("sha256", Text, nullable=False),
    Column("published_ms", BigInteger, nullable=False),
    Column("content", LargeBinary, nullable=False),  # GeoJSON
)

#: The stations of all current versions; each id belongs to one network.
stations = Table(
    "stations",
    metadata,
    Column("station_id", Text, primary_key=True),
    Column("network_id", Text, ForeignKey("networks.network_id"), nullable=False),
    Column("name", Text),
    Column("pads", Integer, nullable=False),
    Column("longitude_deg", Double, nullable=False),
    Column("latitude_deg", Double, nullable=False),
    Index("stations_by_network", "network_id", "station_id"),
)


#: One pad in [start_ms, end_ms). A mission's row exists exactly as long as the mission is not over.
#: A held offer's row counts until `held_until_ms`, and is deleted soon after.
pad_reservations = Table(
    "pad_reservations",
    metadata,
    Column("station_id", Text, primary_key=True),
    Column("pad", Integer, primary_key=True),
    Column("start_ms", BigInteger, primary_key=True),
    Column("end_ms", BigInteger, nullable=False),
    Column("mission_id", Text, ForeignKey("missions.mission_id")),
    Column("hold_id", Text, ForeignKey("offer_holds.hold_id")),
    Column("held_until_ms", BigInteger),
    CheckConstraint("start_ms < end_ms", name="pad_reservation_lasts"),
    CheckConstraint(
        "(mission_id IS NULL) = (hold_id IS NOT NULL) "
        "AND (hold_id IS NULL) = (held_until_ms IS NULL)",
        name="pad_reservation_owner",
    ),
    Index("pad_reservations_by_mission", "mission_id"),
    partial_index("pad_reservations_held", "hold_id", where="hold_id IS NOT NULL"),
)


#: Closures, in force from `from_ms` until they end or are lifted.
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

#: The forecast that the plans of a network use; the network's conditions change with it.
forecasts = Table(
    "forecasts",
    metadata,
    Column("network_id", Text, ForeignKey("networks.network_id"), primary_key=True),
    Column("sha256", Text, nullable=False),
    Column("received_ms", BigInteger, nullable=False),
    Column("content", LargeBinary, nullable=False),  # JSON of a ForecastDocument
    Column("measured", Text),  # JSON of a MeasuredWind, null before the first
)
