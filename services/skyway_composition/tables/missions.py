"""The tables of missions and of the deliveries that they are booked for."""

from typing import Final

from sqlalchemy import (
    BigInteger,
    Column,
    ForeignKey,
    Index,
    Integer,
    Table,
    Text,
    UniqueConstraint,
    literal_column,
    text,
)

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.runtime.sql.claims import claim_columns
from skyway_composition.tables.metadata import metadata

#: One row per delivery that anything was booked or closed for: the lock both sides take.
deliveries = Table(
    "deliveries",
    metadata,
    Column("delivery_id", Text, primary_key=True),
    Column("closed_ms", BigInteger),
)

missions = Table(
    "missions",
    metadata,
    Column("mission_id", Text, primary_key=True),
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("trip", Integer, nullable=False),
    Column("provider_id", Text, nullable=False),
    Column("drone_id", Text, nullable=False),
    Column("state", Text, nullable=False),
    Column("network_id", Text, ForeignKey("networks.network_id"), nullable=False),
    Column("start_ms", BigInteger, nullable=False),
    Column("released_ms", BigInteger, nullable=False),
    Column("expires_ms", BigInteger, nullable=False),  # of its first instruction
    Column("body", Text, nullable=False),  # JSON of skyway.contracts.mission.Mission
    Column("request", Text, nullable=False),  # JSON of DeliveryRequest
    Column("candidate", Text, nullable=False),  # JSON of Candidate: the drone as it was booked
    Column("report_seq", Integer, nullable=False),
    Column("told", Text),  # the last activity, station that was reported
    Column("stuck", Text),  # JSON of missions.record.Stuck: why it needs a new revision
    Column("trouble", Text),  # JSON of missions.record.Trouble: why its plan does not hold
    Column("proposal", Text),  # JSON of missions.record.Proposal: sent, not accepted yet
    Column("aims", Text, nullable=False, server_default="[]"),  # JSON list of missions.record.Aim
    Column("loading", Text, nullable=False, server_default="AUTOMATIC"),  # of Mission, to find it
    Column("retry_wall_ms", BigInteger, nullable=False, server_default="0"),
    # The first planned end of a step that has not ended; null before the drone has accepted it.
    Column("next_end_ms", BigInteger),
    *claim_columns(),
    UniqueConstraint("delivery_id", "attempt", "trip", name="mission_attempt"),
    # I2: a drone is on at most one mission.
    Index(
        "mission_drone",
        "drone_id",
        unique=True,
        sqlite_where=text("state IN ('BOOKED', 'ACCEPTED', 'ACTIVE')"),
        postgresql_where=text("state IN ('BOOKED', 'ACCEPTED', 'ACTIVE')"),
    ),
    Index("missions_by_state", "state", "released_ms"),
    Index("missions_by_provider", "provider_id", "mission_id"),
    Index(
        "missions_by_next_end",
        "next_end_ms",
        sqlite_where=text("state IN ('ACCEPTED', 'ACTIVE')"),
        postgresql_where=text("state IN ('ACCEPTED', 'ACTIVE')"),
    ),
)

#: Whether a mission is under way. Written out: as parameters, the states would be put in at each
#: execution, and an index of some rows is only used where the statement itself says which.
is_live: Final = missions.c.state.in_(
    [literal_column(f"'{state}'") for state in LIVE_MISSION_STATES]
)

#: Whether its drone has accepted a mission, and not ended it.
is_under_way: Final = missions.c.state.in_(
    [literal_column("'ACCEPTED'"), literal_column("'ACTIVE'")]
)
