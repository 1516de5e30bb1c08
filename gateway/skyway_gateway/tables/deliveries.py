"""Deliveries, and what they consist of: packages, their custody, the missions that fly them."""

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Double,
    ForeignKey,
    Index,
    Integer,
    Table,
    Text,
    UniqueConstraint,
    text,
    true,
)

from skyway.runtime.sql.claims import claim_columns
from skyway_gateway.tables.metadata import metadata

#: A row that `is_queued` is in the queue of `deliveries.book`.
deliveries = Table(
    "deliveries",
    metadata,
    Column("delivery_id", Text, primary_key=True),
    Column("customer_id", Text, nullable=False),
    Column("reference", Text),
    Column("state", Text, nullable=False),
    Column("activity", Text),
    Column("is_delayed", Boolean, nullable=False),
    Column("is_replanning", Boolean, nullable=False),
    Column("request", Text, nullable=False),  # JSON of skyway.delivery.request.DeliveryRequest
    Column("pickup_position", Text, nullable=False),  # JSON of skyway.geo.Position
    Column("created_ms", BigInteger, nullable=False),
    Column("updated_ms", BigInteger, nullable=False),
    Column("give_up_ms", BigInteger, nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("refusals", Text, nullable=False),  # JSON list of deliveries.delivery.Refusal
    Column(
        "reasons", Text, nullable=False
    ),  # JSON list of ProviderReason: why not, at the last try
    Column("last_sequence", Integer, nullable=False),  # of its events
    Column("traceparent", Text),
    # JSON of skyway.contracts.mission.OfferLimits: what the offer that was taken has promised
    Column("offer", Text),
    # Whether packages wait for a mission: what `deliveries.book` looks for, in any state.
    Column("is_queued", Boolean, nullable=False, server_default=true()),
    Column("cancel_reason", Text),  # why all that can still be stopped is to be stopped
    Column("next_try_wall_ms", BigInteger, nullable=False),
    # Counts what was written of the delivery and its parts: who writes from what was read earlier
    # names it. That it waits, or who is booking it, does not count.
    Column("version", Integer, nullable=False, server_default="0"),
    *claim_columns(),
    CheckConstraint(
        "state IN ('REQUESTED', 'PLANNED', 'DISPATCHED', 'LOADING', 'IN_PROGRESS', "
        "'COMPLETED', 'PARTIALLY_COMPLETED', 'CANCELLED', 'FAILED', 'REJECTED')",
        name="delivery_state",
    ),
    Index("deliveries_by_customer", "customer_id", "delivery_id"),
    Index("deliveries_by_state", "state", "next_try_wall_ms"),
    Index("deliveries_queued", "is_queued", "next_try_wall_ms"),
    Index("deliveries_by_time", "created_ms"),
)

packages = Table(
    "packages",
    metadata,
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), primary_key=True),
    Column("package_id", Text, primary_key=True),
    Column("number", Integer, nullable=False),  # its place in the request
    Column("state", Text, nullable=False),
    Column("destination_station_id", Text, nullable=False),
    Column("mass_kg", Double, nullable=False),
    Column("custodian_kind", Text, nullable=False),
    Column("custodian_id", Text, nullable=False),
    Column("custody_seq", Integer, nullable=False),  # of the custodian above
    Column("promised_ms", BigInteger),  # the first ETA of the present attempt
    Column("eta_ms", BigInteger),
    Column("delivered_ms", BigInteger),
    Column("mission_id", Text),  # the mission that carries it; null while it waits for one
    Column("code", Text),  # why it is not delivered
    Column("detail", Text),  # the same in words
    Column("proof", Text),  # JSON of deliveries.proof.Proof: place, time, weights
    Column("position", Text),  # JSON of Position: where it lies with a drone in the open
    CheckConstraint(
        "state IN ('CREATED', 'LOADED', 'IN_TRANSIT', 'DELIVERED', 'RETURNING', 'RETURNED', "
        "'STRANDED', 'CANCELLED')",
        name="package_state",
    ),
)

#: Who held a package, from the pickup station to the recipient: rows are only added.
custody = Table(
    "custody",
    metadata,
    Column("delivery_id", Text, primary_key=True),
    Column("package_id", Text, primary_key=True),
    Column("seq", Integer, primary_key=True),
    Column("custodian_kind", Text, nullable=False),
    Column("custodian_id", Text, nullable=False),
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
    Column("report_seq", Integer, nullable=False),  # of the last report that was applied
    # JSON of deliveries.delivery.FlownMission, but for the state, which changes more often
    Column("body", Text, nullable=False),
    Column("price_amount", BigInteger),  # in minor units of the currency
    Column("currency", Text),
    Column("ended_ms", BigInteger),
    Column("start_ms", BigInteger),  # as it was first booked: revisions begin later
    # What the drone did up to its last hand-over, as it reported.
    Column("flight_s", Double),
    Column("waiting_s", Double),
    Column("recharging_s", Double),
    UniqueConstraint("delivery_id", "attempt", "trip", name="mission_attempt"),
    Index("missions_by_provider", "provider_id", "delivery_id"),
    Index("missions_by_end", "provider_id", "ended_ms"),
)
