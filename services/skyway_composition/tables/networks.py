"""The tables of networks: what was published, and the stations of what is current."""

from sqlalchemy import (
    BigInteger,
    Column,
    Double,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    Table,
    Text,
)

from skyway_composition.tables.metadata import metadata

#: The current version of each network.
networks = Table(
    "networks",
    metadata,
    Column("network_id", Text, primary_key=True),
    Column("version", Integer, nullable=False),
    Column("sha256", Text, nullable=False),
    Column("published_ms", BigInteger, nullable=False),
    # Changes with every closure, zone, outage and ground stop that is made or lifted (I11).
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

#: The stations of all current versions: one id belongs to one network.
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
