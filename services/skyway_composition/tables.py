"""The tables of composition; `_ms` is fleet time, `_wall_ms` wall time, in ms since 1970."""

from typing import Final

from sqlalchemy import (
    BigInteger,
    Boolean,
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
    UniqueConstraint,
    false,
    func,
    literal_column,
    select,
    text,
)

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.runtime.outbox.table import outbox_table
from skyway.runtime.sql.claims import claim_columns

metadata = MetaData()

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

#: What was sent to a drone, and its answer.
instructions = Table(
    "instructions",
    metadata,
    Column("instruction_id", Text, primary_key=True),
    Column("drone_id", Text, nullable=False),
    Column("stream", Integer, nullable=False),
    Column("seq", Integer, nullable=False),
    Column("kind", Text, nullable=False),
    Column("mission_id", Text, ForeignKey("missions.mission_id")),
    Column("mission_revision", Integer),
    Column("status", Text, nullable=False),
    Column("body", Text, nullable=False),  # JSON of Instruction
    CheckConstraint(
        "status IN ('SENT', 'RECEIVED', 'ACCEPTED', 'REJECTED', 'REISSUED')",
        name="instruction_status",
    ),
    UniqueConstraint("drone_id", "stream", "seq", name="instruction_order"),
    Index("instructions_by_mission", "mission_id"),
)

#: Per drone: the order of what goes to it, and how far we know what comes from it.
drone_links = Table(
    "drone_links",
    metadata,
    Column("drone_id", Text, primary_key=True),
    Column("provider_id", Text, nullable=False),
    Column("stream", Integer, nullable=False),  # 0 before the first instruction
    Column("last_seq", Integer, nullable=False),  # of the instructions in this stream
    Column("acked_stream", Integer, nullable=False),  # the last one that the drone has shown,
    Column("acked_session", BigInteger, nullable=False),  # and the session in which it did
    Column("last_event_seq", BigInteger, nullable=False),
    Column("report_asked_wall_ms", BigInteger, nullable=False),
    Column("state", Text),  # JSON of DroneState, the newest,
    Column("is_occupied", Boolean, nullable=False, server_default=false()),  # and what it says
    Column("connection", Text),  # JSON of Connection, the newest
    # Most drones are not: their links are not looked at to find those that are.
    Index(
        "drone_links_occupied",
        "drone_id",
        sqlite_where=text("is_occupied = 1"),
        postgresql_where=text("is_occupied"),
    ),
)

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

alarms = Table(
    "alarms",
    metadata,
    Column("alarm_id", Text, primary_key=True),
    Column("level", Text, nullable=False),
    Column("code", Text, nullable=False),
    Column("detail", Text, nullable=False),
    Column("at_ms", BigInteger, nullable=False),
    Column("provider_id", Text),
    Column("drone_id", Text),
    Column("mission_id", Text),
    Column("station_id", Text),
    Column("data", Text, nullable=False),  # JSON object
    Column("acknowledged_ms", BigInteger),
    Column("acknowledged_by", Text),
    Column("note", Text),  # of whoever acknowledged it
    CheckConstraint("level IN ('WARNING', 'URGENT', 'CRITICAL')", name="alarm_level"),
    Index("alarms_open", "acknowledged_ms", "alarm_id"),
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

outbox = outbox_table(metadata)
