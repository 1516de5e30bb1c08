"""The table of reserved pads."""

from sqlalchemy import BigInteger, CheckConstraint, Column, ForeignKey, Index, Integer, Table, Text

from skyway_composition.tables.metadata import metadata

#: Exists exactly as long as its mission lives; [start_ms, end_ms) of one pad.
pad_reservations = Table(
    "pad_reservations",
    metadata,
    Column("station_id", Text, primary_key=True),
    Column("pad", Integer, primary_key=True),
    Column("start_ms", BigInteger, primary_key=True),
    Column("end_ms", BigInteger, nullable=False),
    Column("mission_id", Text, ForeignKey("missions.mission_id"), nullable=False),
    CheckConstraint("start_ms < end_ms", name="pad_reservation_lasts"),
    Index("pad_reservations_by_mission", "mission_id"),
)
