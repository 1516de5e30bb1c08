"""Deliveries, their packages, the custody of packages, and the missions that fly them.

`_ms` is fleet time, in ms since 1970. `tables` has all other tables of the gateway.
"""

from typing import Final

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    ColumnElement,
    Double,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    SmallInteger,
    Table,
    Text,
    UniqueConstraint,
    false,
    text,
    true,
)

from skyway.ids import TEST_PREFIX
from skyway.runtime.sql.claims import claim_columns
from skyway.runtime.sql.partial_index import partial_index

metadata = MetaData()


def is_live_row(subject_id: ColumnElement[str]) -> ColumnElement[bool]:
    """Whether a row of any table belongs to a live account, by the column that names it."""
    return ~subject_id.startswith(TEST_PREFIX, autoescape=True)


#: Deliveries that are not over. The query of an index must repeat the condition of the index.
IS_LIVE: Final = (
    "state IN ('SCHEDULED', 'REQUESTED', 'PLANNED', 'DISPATCHED', 'LOADING', 'IN_PROGRESS')"
)

#: Deliveries that are over. Of an expression, because SQLite would take `deliveries_by_state` for a
#: column, and read all deliveries that are over to find the oldest.
IS_OVER: Final = (
    "(state || '') IN ('COMPLETED', 'PARTIALLY_COMPLETED', 'CANCELLED', 'FAILED', 'REJECTED')"
)

#: Deliveries of test accounts, by their ids.
IS_TEST: Final = "substr(delivery_id, 1, 9) = 'dlv_test_'"

#: Rows with `is_queued` are the queue of `deliveries.booking`.
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
    Column("earliest_pickup_ms", BigInteger),  # as the customer asked; null without such a wish
    Column("attempt", Integer, nullable=False),
    Column("refusals", Text, nullable=False),  # JSON list of deliveries.lifecycle.delivery.Refusal
    Column(
        "reasons", Text, nullable=False
    ),  # JSON list of ProviderReason: why not, at the last try
    Column("last_sequence", Integer, nullable=False),  # of its events
    # The hash of all its events in order, as `notifications.event_store.hash_after` chains them.
    Column("events_hash", Text, nullable=False, server_default=text("''")),
    # Whether the answer to its request is stored under an Idempotency-Key.
    Column("has_idempotency_key", Boolean, nullable=False, server_default=false()),
    Column("traceparent", Text),
    # JSON of skyway.contracts.mission.OfferLimits: the limits of the accepted offer
    Column("offer", Text),
    # Whether packages wait for a mission, in any state: booking looks for these rows.
    Column("is_queued", Boolean, nullable=False, server_default=true()),
    Column("cancel_reason", Text),  # set when the whole delivery is being cancelled
    # When booking looks at it next; once it is over, when `retention` may look at it again.
    Column("next_try_wall_ms", BigInteger, nullable=False),
    Column("network_id", Text),  # of the pickup; null when the gateway did not know it
    # The order of requests that wait: PRIORITY (0) before STANDARD (1), then by `created_ms`.
    Column("queue_rank", SmallInteger, nullable=False, server_default="1"),
    # Since when no drone was free for it, fleet time; null while it does not wait.
    Column("waits_since_ms", BigInteger),
    # Since when composition was asked to book it and has not answered, wall time; null otherwise.
    # It may have booked a mission: these rows come before new requests.
    Column("asked_wall_ms", BigInteger),
    # When something last changed that may help it; later tries are further and further apart.
    Column("woken_wall_ms", BigInteger, nullable=False, server_default="0"),
    # Counts the writes of the delivery and its parts; a write names the version that it starts
    # from. Changes of the queue columns do not count.
    Column("version", Integer, nullable=False, server_default="0"),
    # Whether it is being deleted: composition may have deleted it already.
    Column("is_leaving", Boolean, nullable=False, server_default=false()),
    *claim_columns(),
    CheckConstraint(
        "state IN ('SCHEDULED', 'REQUESTED', 'PLANNED', 'DISPATCHED', 'LOADING', 'IN_PROGRESS', "
        "'COMPLETED', 'PARTIALLY_COMPLETED', 'CANCELLED', 'FAILED', 'REJECTED')",
        name="delivery_state",
    ),
    Index("deliveries_by_customer", "customer_id", "delivery_id"),
    Index("deliveries_by_state", "state", "next_try_wall_ms"),
    Index("deliveries_queued", "is_queued", "next_try_wall_ms"),
    Index("deliveries_by_time", "created_ms"),
    partial_index(
        "deliveries_waiting",
        "network_id",
        "queue_rank",
        "created_ms",
        "delivery_id",
        where="waits_since_ms IS NOT NULL",
    ),
    # For the count of what one customer has.
    partial_index("deliveries_live", "customer_id", "state", where=IS_LIVE),
    # For those that are deleted after some days.
    partial_index("deliveries_over", "updated_ms", where=IS_OVER),
    partial_index("deliveries_test", "updated_ms", where=IS_TEST),
    # Few deliveries are SCHEDULED: the others cost this index nothing.
    partial_index("deliveries_scheduled", "earliest_pickup_ms", where="state = 'SCHEDULED'"),
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
    Column("promised_ms", BigInteger),  # the first ETA of the current attempt
    # By when nine of ten packages should come, known at the booking; null if it was not known.
    Column("promised_p90_ms", BigInteger),
    # `promised_ms` or `promised_p90_ms`, as the customer asked: lateness counts from it. Null
    # before the first promise.
    Column("due_ms", BigInteger),
    Column("eta_ms", BigInteger),
    Column("delivered_ms", BigInteger),
    Column("mission_id", Text),  # the mission that carries it; null while it waits for one
    Column("code", Text),  # why it is not delivered
    Column("detail", Text),  # the same in words
    Column("proof", Text),  # JSON of deliveries.lifecycle.delivery.Proof
    Column("position", Text),  # JSON of Position: where it lies with a drone in the open
    # JSON of deliveries.lifecycle.delivery.ProofWait: since when and until when a drone waited
    Column("proof_wait", Text),
    CheckConstraint(
        "state IN ('CREATED', 'LOADED', 'IN_TRANSIT', 'DELIVERED', 'RETURNING', 'RETURNED', "
        "'STRANDED', 'CANCELLED')",
        name="package_state",
    ),
    # For the lateness of the last packages.
    partial_index("packages_delivered", "delivered_ms", where="delivered_ms IS NOT NULL"),
)

#: Who held a package, from the pickup station to the recipient; rows are only added.
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
    # Invariant I6: a package is delivered once.
    partial_index(
        "custody_delivered",
        "delivery_id",
        "package_id",
        unique=True,
        where="custodian_kind = 'RECIPIENT'",
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
    # JSON of deliveries.lifecycle.flown_mission.FlownMission; the state is in its own column
    Column("body", Text, nullable=False),
    Column("price_amount", BigInteger),  # as booked, in minor units of the currency
    # What its customer pays; null until all its packages are settled.
    Column("charged_amount", BigInteger),
    Column("currency", Text),
    Column("ended_ms", BigInteger),
    Column("start_ms", BigInteger, nullable=False),  # as first booked; later revisions start later
    # JSON of skyway.delivery.lateness.Conditions: what was known when its packages were promised
    Column("promised_on", Text),
    # What the drone did up to its last hand-over, as it reported.
    Column("flight_s", Double),
    Column("waiting_s", Double),
    Column("recharging_s", Double),
    UniqueConstraint("delivery_id", "attempt", "trip", name="mission_attempt"),
    Index("missions_by_provider", "provider_id", "delivery_id"),
)

#: The missions that came to a provider or left it by exchange: a row for each of the two. The one
#: that it left sees nothing else of its delivery any more.
exchanges = Table(
    "exchanges",
    metadata,
    Column("provider_id", Text, primary_key=True),
    # Of `delivery.replanned`, by which the customer was notified: ids of events sort by their time.
    Column("event_id", Text, primary_key=True),
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), nullable=False, index=True),
    Column("mission_id", Text, nullable=False),
    Column("direction", Text, nullable=False),
    Column("at_ms", BigInteger, nullable=False),
    CheckConstraint("direction IN ('CAME', 'LEFT')", name="exchange_direction"),
)

#: The proofs without which packages are not handed over. No other table has their PINs, signatures
#: and photos. A PIN leaves when it is of no use, a picture at `due_ms` or earlier.
proofs = Table(
    "proofs",
    metadata,
    Column("delivery_id", Text, ForeignKey("deliveries.delivery_id"), primary_key=True),
    Column("package_id", Text, primary_key=True),
    Column("method", Text, nullable=False),
    Column("pin", Text),
    Column("wrong_pins", SmallInteger, nullable=False, server_default=text("0")),
    Column("given_by", Text),
    Column("given_ms", BigInteger),
    Column("signature", Text),  # JSON of proofs.signature.Signature
    # Whether the store of photos has, or may still have, its photo.
    Column("has_photo", Boolean, nullable=False, server_default=false()),
    Column("due_ms", BigInteger),
    CheckConstraint("method IN ('PIN', 'PHOTO', 'SIGNATURE')", name="proof_method"),
    CheckConstraint(
        "given_by IN ('RECIPIENT', 'KEYPAD', 'DRONE', 'CUSTOMER', 'OPERATOR')", name="proof_giver"
    ),
    CheckConstraint("wrong_pins BETWEEN 0 AND 5", name="proof_wrong_pins"),
    CheckConstraint("(given_by IS NULL) = (given_ms IS NULL)", name="proof_given"),
    CheckConstraint(
        "pin IS NULL OR (method = 'PIN' AND given_ms IS NULL)", name="proof_pin_is_of_use"
    ),
    partial_index("proofs_with_pin", "delivery_id", where="pin IS NOT NULL"),
    partial_index("proofs_with_picture", "due_ms", where="due_ms IS NOT NULL"),
)
