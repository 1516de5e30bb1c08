"""The table of missions whose drones did not come."""

from sqlalchemy import BigInteger, Column, ForeignKey, Index, Table, Text

from skyway_composition.tables.networks import metadata

#: A mission that ended because its drone did not answer, or fell silent. Rows are only added.
no_shows = Table(
    "no_shows",
    metadata,
    Column("mission_id", Text, ForeignKey("missions.mission_id"), primary_key=True),
    Column("provider_id", Text, nullable=False),
    Column("drone_id", Text, nullable=False),
    Column("code", Text, nullable=False),
    Column("at_ms", BigInteger, nullable=False),
    Index("no_shows_by_time", "at_ms", "provider_id"),
)
