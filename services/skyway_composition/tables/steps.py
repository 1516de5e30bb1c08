"""The tables of the steps of missions."""

from typing import Final

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    ForeignKey,
    Index,
    Integer,
    Table,
    Text,
    func,
    select,
    text,
)

from skyway_composition.tables.metadata import metadata
from skyway_composition.tables.missions import missions

#: The steps of a mission through all its revisions, as they were sent, and how they ended.
mission_steps = Table(
    "mission_steps",
    metadata,
    Column("mission_id", Text, ForeignKey("missions.mission_id"), primary_key=True),
    Column("step_id", Integer, primary_key=True),
    Column("revision", Integer, nullable=False),
    Column("status", Text, nullable=False),
    Column("step", Text, nullable=False),  # JSON of FlightStep
    Column("started_ms", BigInteger),
    Column("ended_ms", BigInteger),
    Column("event", Text),  # JSON of DroneEvent: the evidence
    # What statistics add up, of the step; null in rows of an older version.
    Column("kind", Text),
    Column("station_id", Text),  # where it is done; null for a flight
    Column("pad", Integer),  # of a RECHARGE
    # What closures are compared with: of every step, and of a FLY.
    Column("planned_start_ms", BigInteger),
    Column("planned_end_ms", BigInteger),
    Column("from_station_id", Text),
    Column("to_station_id", Text),
    Column("lands", Boolean),
    CheckConstraint("status IN ('PLANNED', 'ENDED', 'FAILED')", name="mission_step_status"),
    Index("mission_steps_by_time", "ended_ms"),
    Index(
        "mission_steps_to_fly",
        "to_station_id",
        "from_station_id",
        sqlite_where=text("status = 'PLANNED' AND kind = 'FLY'"),
        postgresql_where=text("status = 'PLANNED' AND kind = 'FLY'"),
    ),
)

#: The first planned end of a mission's steps that have not ended.
first_planned_end_ms: Final = (
    select(func.min(mission_steps.c.planned_end_ms))
    .where(mission_steps.c.mission_id == missions.c.mission_id, mission_steps.c.status == "PLANNED")
    .correlate(missions)
    .scalar_subquery()
)

#: Steps that a new revision has cut, whose numbers the steps in their places have now.
cut_steps = Table(
    "cut_steps",
    metadata,
    Column("mission_id", Text, ForeignKey("missions.mission_id"), primary_key=True),
    Column("seq", BigInteger, primary_key=True),  # of the event
    Column("step_id", Integer),
    Column("kind", Text),
    Column("station_id", Text),
    Column("started_ms", BigInteger, nullable=False),
    Column("ended_ms", BigInteger, nullable=False),
    Column("event", Text, nullable=False),  # JSON of DroneEvent: the evidence
    Index("cut_steps_by_time", "ended_ms"),
)
