"""The tables of deliveries, missions, their parts, held offers, alarms and better orders."""

from typing import Final

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    ForeignKey,
    Index,
    Integer,
    SmallInteger,
    Table,
    Text,
    UniqueConstraint,
    func,
    literal_column,
    or_,
    select,
)

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.runtime.sql.claims import claim_columns
from skyway.runtime.sql.partial_index import partial_index
from skyway_composition.tables.networks import metadata

#: One row for each delivery that was booked or closed; booking and closing both lock this row.
deliveries = Table(
    "deliveries",
    metadata,
    Column("delivery_id", Text, primary_key=True),
    Column("closed_ms", BigInteger),
    # The last attempt whose request has changed since: nothing is booked for it any more.
    Column("withdrawn_attempt", Integer, nullable=False, server_default="0"),
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
    Column("told", Text),  # MissionRecord.reported_activity; the name is older
    Column("stuck", Text),  # JSON of missions.record.Stuck: why it needs a new revision
    Column("trouble", Text),  # JSON of missions.record.Trouble: why its plan does not hold
    Column("proposal", Text),  # JSON of missions.record.Proposal: sent, not accepted yet
    Column("aims", Text, nullable=False, server_default="[]"),  # JSON list of missions.record.Aim
    Column("loading", Text, nullable=False, server_default="AUTOMATIC"),  # of Mission, to find it
    Column("retry_wall_ms", BigInteger, nullable=False, server_default="0"),
    # The first planned end of a step that has not ended; null before the drone has accepted it.
    Column("next_end_ms", BigInteger),
    # JSON of skyway.scheduling.stays: where another mission can begin; null where none can.
    Column("stays", Text),
    # The end of the last hand-over. QUEUED missions of a drone do not overlap until then.
    Column("served_ms", BigInteger, nullable=False),
    # The network's version and conditions with which a QUEUED mission was planned.
    Column("planned_version", Integer),
    Column("planned_conditions", BigInteger),
    # The trace in which the mission was booked: that of the request of its delivery.
    Column("traceparent", Text),
    # JSON list of PackageEta: the arrival times that were promised for a QUEUED mission.
    Column("promised", Text),
    # When the promise of a QUEUED mission becomes firm; null once it is firm.
    Column("firm_ms", BigInteger),
    # JSON list of missions.mission.share.Share; null while the mission is not shared.
    Column("shares", Text),
    # The pickup station, if packages of other deliveries may join a QUEUED mission; else null.
    Column("pooling_at", Text),
    # How many rows of `cut_steps` it has.
    Column("cuts", Integer, nullable=False, server_default="0"),
    *claim_columns(),
    UniqueConstraint("delivery_id", "attempt", "trip", name="mission_attempt"),
    # I2: a drone is on at most one mission.
    partial_index(
        "mission_drone", "drone_id", unique=True, where="state IN ('BOOKED', 'ACCEPTED', 'ACTIVE')"
    ),
    partial_index("missions_queued", "drone_id", "start_ms", where="state = 'QUEUED'"),
    partial_index(
        "missions_to_join", "pooling_at", where="state = 'QUEUED' AND pooling_at IS NOT NULL"
    ),
    Index("missions_by_state", "state", "released_ms"),
    Index("missions_by_provider", "provider_id", "mission_id"),
    partial_index("missions_by_next_end", "next_end_ms", where="state IN ('ACCEPTED', 'ACTIVE')"),
)

#: Whether a mission is live. The states are literals, because the database uses a partial index
#: only when the statement itself contains the index's condition.
is_live: Final = missions.c.state.in_(
    [literal_column(f"'{state}'") for state in LIVE_MISSION_STATES]
)

#: Whether a mission waits for the missions before it in its drone's calendar.
is_queued: Final = missions.c.state == literal_column("'QUEUED'")

#: Whether a mission is not over: it is live or queued.
is_open: Final = or_(is_live, is_queued)

#: Whether the drone has accepted the mission and has not ended it.
is_under_way: Final = missions.c.state.in_(
    [literal_column("'ACCEPTED'"), literal_column("'ACTIVE'")]
)

#: The deliveries whose packages fly with the mission of another delivery. The gateway sees each as
#: a mission of its own; `shares` of the host's row has all else about it.
guests = Table(
    "guests",
    metadata,
    Column("mission_id", Text, primary_key=True),
    Column("host_id", Text, ForeignKey("missions.mission_id"), nullable=False),
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), nullable=False),
    Column("attempt", Integer, nullable=False),
    UniqueConstraint("delivery_id", "attempt", name="guest_attempt"),
    Index("guests_by_host", "host_id"),
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
    # For statistics.
    Column("kind", Text, nullable=False),
    Column("station_id", Text),  # where the drone does the step; null for a flight
    Column("pad", Integer),  # of a RECHARGE
    # For closures: the planned times of every step, and the stations of a FLY.
    Column("planned_start_ms", BigInteger, nullable=False),
    Column("planned_end_ms", BigInteger, nullable=False),
    Column("from_station_id", Text),
    Column("to_station_id", Text),
    Column("lands", Boolean),
    CheckConstraint("status IN ('PLANNED', 'ENDED', 'FAILED')", name="mission_step_status"),
    Index("mission_steps_by_time", "ended_ms"),
    partial_index(
        "mission_steps_to_fly",
        "to_station_id",
        "from_station_id",
        where="status = 'PLANNED' AND kind = 'FLY'",
    ),
)

#: The first planned end of a mission's steps that have not ended.
first_planned_end_ms: Final = (
    select(func.min(mission_steps.c.planned_end_ms))
    .where(mission_steps.c.mission_id == missions.c.mission_id, mission_steps.c.status == "PLANNED")
    .correlate(missions)
    .scalar_subquery()
)

#: Steps that a new revision has cut short; the steps that replace them have the same numbers.
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
    # A mission that is deleted must have no custody any more.
    Index("custody_by_mission", "mission_id"),
    # I6: delivered once.
    partial_index(
        "custody_delivered",
        "delivery_id",
        "package_id",
        unique=True,
        where="custodian_kind = 'RECIPIENT'",
    ),
)

#: The proofs that a drone waits for, or has waited for, in a DELIVER. A package that goes to its
#: alternative needs a new one there.
proofs = Table(
    "proofs",
    metadata,
    Column("mission_id", Text, ForeignKey("missions.mission_id"), primary_key=True),
    Column("step_id", Integer, primary_key=True),
    Column("flying_id", Text, primary_key=True),  # the package, by the id under which it flies
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), nullable=False),
    Column("package_id", Text, nullable=False),  # by the customer's id
    Column("method", Text, nullable=False),
    Column("until_ms", BigInteger, nullable=False),  # when the drone gives up
    Column("given_ms", BigInteger),  # when the proof came; null without one
    Column("pins", SmallInteger, nullable=False),  # typed at the drone
    CheckConstraint("method IN ('PIN', 'PHOTO', 'SIGNATURE')", name="proof_method"),
    Index("proofs_by_package", "delivery_id", "package_id"),
)

#: Cancellations and their answers, so that a repeated cancellation gets the same answer.
cancellations = Table(
    "cancellations",
    metadata,
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), primary_key=True),
    Column("cancellation_id", Text, primary_key=True),
    Column("answer", Text, nullable=False),  # JSON of skyway.contracts.mission.Cancellation
    Column("at_ms", BigInteger, nullable=False),
)

#: One row for each quote whose offers are held, and for each offer that is being accepted. Its pads
#: are in `pad_reservations`, its drones are marked in `drone_links`.
offer_holds = Table(
    "offer_holds",
    metadata,
    Column("hold_id", Text, primary_key=True),
    Column("customer_id", Text, nullable=False),
    # Numbers the holds of a customer from 1 to its limit; null for an offer that is being accepted.
    Column("slot", SmallInteger),
    Column("until_ms", BigInteger, nullable=False),  # from then on nothing is held
    Column("offers", Text, nullable=False),  # JSON list of missions.booking.hold_store.HeldOffer
    UniqueConstraint("customer_id", "slot", name="hold_slot"),
    CheckConstraint("slot >= 1", name="hold_slot_counts"),
    Index("offer_holds_by_end", "until_ms"),
)

#: Problems that operators must acknowledge, or have acknowledged.
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
    Column("note", Text),  # the remark of the operator who acknowledged the alarm
    CheckConstraint("level IN ('WARNING', 'URGENT', 'CRITICAL')", name="alarm_level"),
    Index("alarms_open", "acknowledged_ms", "alarm_id"),
    # Counts the open alarms of a drone without reading those of all others.
    partial_index("alarms_open_of_drone", "drone_id", "level", where="acknowledged_ms IS NULL"),
)

#: A day of fleet time, milliseconds.
DAY_MS: Final = 24 * 3600 * 1000

#: The better orders of a provider that were adopted on a day of fleet time, which begins at
#: `day_ms`: how many orders, missions that changed their drone, and milliseconds of deliveries.
better_orders = Table(
    "better_orders",
    metadata,
    Column("provider_id", Text, primary_key=True),
    Column("day_ms", BigInteger, primary_key=True),
    Column("orders", Integer, nullable=False),
    Column("moves", Integer, nullable=False),
    Column("saved_ms", BigInteger, nullable=False),
)
