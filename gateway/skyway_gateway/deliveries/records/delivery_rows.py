"""Deliveries as the database holds them: which column holds what, and a cache of the latest.

The cache saves the next step a read. It cannot do harm when it is out of date: each write names the
version that it starts from, and a row with another version is not written.
"""

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from pydantic import TypeAdapter

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.mission import OfferLimits
from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.qos import PRIORITY_RANKS
from skyway.delivery.request import DeliveryRequest, Place
from skyway.geo import Position
from skyway.ids import DeliveryId, NetworkId
from skyway.runtime.sql.connection import AnyRow
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.delivery import (
    Delivery,
    Flags,
    PackageStatus,
    Proof,
    ProofWait,
)
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission, Refusal
from skyway_gateway.lateness.lateness_forecast import conditions_of
from skyway_gateway.notifications.event_store import NumberedEvent, hash_after

#: How many are cached. A busy gateway accepts as many in some seconds; most are dispatched by then.
_MOST_CACHED: Final = 500


class Outdated(Exception):
    """Somebody wrote the delivery after it was read: read it again, under a lock."""


@dataclass(frozen=True, slots=True)
class StoredDelivery:
    """A delivery, the version of its row, and the number and the hash of its events so far.

    `traceparent` is that of its request: all that is said about the delivery is in its trace. A
    cached delivery may hold moments that are more exact than the stored milliseconds.
    """

    delivery: Delivery
    version: int = 0
    last_sequence: int = 0
    events_hash: str = ""
    traceparent: str | None = None

    def then(self, delivery: Delivery, new_events: Sequence[NumberedEvent]) -> "StoredDelivery":
        """The next version, which holds this delivery and has these events more."""
        events_hash = self.events_hash
        for each in new_events:
            events_hash = hash_after(
                events_hash, body=each.body, recorded_wall_ms=each.recorded_wall_ms
            )
        sequence = self.last_sequence + len(new_events)
        return StoredDelivery(delivery, self.version + 1, sequence, events_hash, self.traceparent)


class DeliveryCache:
    """Holds the deliveries that were written last; all others are read from the database."""

    def __init__(self) -> None:
        self._cached: OrderedDict[DeliveryId, StoredDelivery] = OrderedDict()

    def pop(self, delivery_id: DeliveryId) -> StoredDelivery | None:
        """Remove a delivery from the cache, to write its next version; None when it is not cached.

        `remember` puts it back after the commit. If the write fails, the next step reads it.
        """
        return self._cached.pop(delivery_id, None)

    def matching(
        self, versions: Iterable[tuple[DeliveryId, int]]
    ) -> dict[DeliveryId, StoredDelivery]:
        """The cached deliveries among these that have exactly the given version."""
        pairs = ((self._cached.get(delivery_id), version) for delivery_id, version in versions)
        return {
            stored.delivery.delivery_id: stored
            for stored, version in pairs
            if stored is not None and stored.version == version
        }

    def remember(self, stored: StoredDelivery) -> None:
        """Cache what was just committed."""
        delivery = stored.delivery
        before = self._cached.pop(delivery.delivery_id, stored)
        if any(mission.state == "REFUSED" for mission in delivery.missions):
            return  # the database answers without the refused mission
        self._cached[delivery.delivery_id] = max(before, stored, key=lambda one: one.version)
        if len(self._cached) > _MOST_CACHED:
            self._cached.popitem(last=False)


@dataclass(frozen=True, slots=True)
class QueuedDelivery:
    """A delivery with packages that wait for a mission, and what else is stored of its request."""

    stored: StoredDelivery
    pickup_position: Position
    give_up_at: datetime
    has_idempotency_key: bool = False
    #: The network of its pickup; None when the gateway does not know it.
    network_id: NetworkId | None = None
    #: Whether it has found no drone yet, or stands behind requests that have found none.
    is_waiting: bool = False
    #: Since when composition was asked and has not answered, wall time; None otherwise.
    asked_at: datetime | None = None
    #: When something last changed that may help it, wall time in ms since 1970.
    woken_wall_ms: int = 0

    @property
    def traceparent(self) -> str | None:
        """The traceparent of its request."""
        return self.stored.traceparent

    @property
    def delivery(self) -> Delivery:
        """The delivery, as it was when it was claimed."""
        return self.stored.delivery


#: The values of a row by the names of their columns.
Values = dict[str, object]

_POSITION: Final = TypeAdapter(Position)
_REASONS: Final = TypeAdapter(tuple[ProviderReason, ...])
_REFUSALS: Final = TypeAdapter(tuple[Refusal, ...])


def new_delivery(queued: QueuedDelivery) -> Values:
    """The row of a delivery that was just accepted."""
    delivery = queued.delivery
    return {
        "delivery_id": delivery.delivery_id,
        "customer_id": delivery.customer_id,
        "pickup_position": _POSITION.dump_json(queued.pickup_position).decode(),
        "created_ms": moment_to_ms(delivery.created_at),
        "give_up_ms": moment_to_ms(queued.give_up_at),
        "traceparent": queued.traceparent,
        "has_idempotency_key": queued.has_idempotency_key,
        "next_try_wall_ms": 0,
        "network_id": queued.network_id,
        "woken_wall_ms": queued.woken_wall_ms,
        **request_values(delivery),
        **changing(queued.stored),
    }


def request_values(delivery: Delivery) -> Values:
    """The columns that change with its request."""
    request = delivery.request
    return {
        "request": request.model_dump_json(),
        "offer": delivery.offer and delivery.offer.model_dump_json(),
        "earliest_pickup_ms": _ms(request.first_hand_over_at),
        "queue_rank": PRIORITY_RANKS[request.qos.priority],
    }


def reasons_text(reasons: Sequence[ProviderReason]) -> str:
    """Reasons as JSON."""
    return _REASONS.dump_json(tuple(reasons)).decode()


def changing(stored: StoredDelivery) -> Values:
    """The columns of a delivery that change during its life."""
    delivery = stored.delivery
    return {
        "version": stored.version,
        "last_sequence": stored.last_sequence,
        "events_hash": stored.events_hash,
        "state": delivery.state,
        "activity": delivery.activity,
        "reference": delivery.reference,
        "is_delayed": delivery.flags.delayed,
        "is_replanning": delivery.flags.replanning,
        "updated_ms": moment_to_ms(delivery.updated_at),
        "attempt": delivery.attempt,
        "refusals": _REFUSALS.dump_json(delivery.refusals).decode(),
        "reasons": _REASONS.dump_json(delivery.reasons).decode(),
        "is_queued": delivery.is_queued,
    }


def delivery_of(
    row: AnyRow, packed: Sequence[PackageStatus], flown: Sequence[FlownMission]
) -> Delivery:
    """The delivery in a row, with its parts."""
    return Delivery(
        delivery_id=row.delivery_id,
        customer_id=row.customer_id,
        state=row.state,
        activity=row.activity,
        flags=Flags(delayed=row.is_delayed, replanning=row.is_replanning),
        reference=row.reference,
        request=DeliveryRequest.read(row.request),
        created_at=ms_to_moment(row.created_ms),
        updated_at=ms_to_moment(row.updated_ms),
        attempt=row.attempt,
        price=event_data.price_of(flown),
        provider_id=flown[0].provider_id if flown else None,
        missions=tuple(flown),
        packages=tuple(packed),
        refusals=_REFUSALS.validate_json(row.refusals),
        reasons=_REASONS.validate_json(row.reasons),
        offer=None if row.offer is None else OfferLimits.read(row.offer),
        cancel_reason=row.cancel_reason,
    )


def stored_of(row: AnyRow, delivery: Delivery) -> StoredDelivery:
    """The delivery in a row, with the row's version."""
    return StoredDelivery(
        delivery, row.version, row.last_sequence, row.events_hash, row.traceparent
    )


def queued_of(row: AnyRow, stored: StoredDelivery) -> QueuedDelivery:
    """The queued delivery in a row."""
    return QueuedDelivery(
        stored=stored,
        pickup_position=_POSITION.validate_json(row.pickup_position),
        give_up_at=ms_to_moment(row.give_up_ms),
        has_idempotency_key=row.has_idempotency_key,
        network_id=row.network_id,
        is_waiting=row.waits_since_ms is not None,
        asked_at=None if row.asked_wall_ms is None else ms_to_moment(row.asked_wall_ms),
        woken_wall_ms=row.woken_wall_ms,
    )


def new_packages(delivery: Delivery) -> list[Values]:
    """The rows of its packages."""
    return [
        {
            "delivery_id": delivery.delivery_id,
            "package_id": package.package_id,
            "number": number,
            "custody_seq": 1,
            **package_values(package),
        }
        for number, package in enumerate(delivery.packages)
    ]


def package_values(package: PackageStatus) -> Values:
    """The columns of a package that change during its life."""
    return {
        "destination_station_id": package.destination.station_id,
        "mass_kg": package.mass_kg,
        "state": package.state,
        "custodian_kind": package.custodian.kind,
        "custodian_id": package.custodian.id,
        "promised_ms": _ms(package.promised_at),
        "promised_p90_ms": _ms(package.promised_p90_at),
        "due_ms": _ms(package.due_at),
        "eta_ms": _ms(package.eta_at),
        "delivered_ms": _ms(package.delivered_at),
        "mission_id": package.mission_id,
        "code": package.code,
        "detail": package.detail,
        "proof": package.proof and package.proof.model_dump_json(),
        "proof_wait": package.proof_wait and package.proof_wait.model_dump_json(),
        "position": package.position and _POSITION.dump_json(package.position).decode(),
    }


def first_custody_row(delivery: Delivery, package: PackageStatus) -> Values:
    """The first row of a package's chain of custody."""
    return {
        "delivery_id": delivery.delivery_id,
        "package_id": package.package_id,
        "seq": 1,
        "custodian_kind": package.custodian.kind,
        "custodian_id": package.custodian.id,
        "at_ms": moment_to_ms(delivery.updated_at),
    }


def package_of(row: AnyRow) -> PackageStatus:
    """The package in a row."""
    return PackageStatus(
        package_id=row.package_id,
        state=row.state,
        destination=Place(station_id=row.destination_station_id),
        mass_kg=row.mass_kg,
        custodian=Custodian(kind=row.custodian_kind, id=row.custodian_id),
        promised_at=_moment(row.promised_ms),
        promised_p90_at=_moment(row.promised_p90_ms),
        due_at=_moment(row.promised_ms if row.due_ms is None else row.due_ms),
        eta_at=_moment(row.eta_ms),
        delivered_at=_moment(row.delivered_ms),
        mission_id=row.mission_id,
        code=row.code,
        detail=row.detail,
        proof=None if row.proof is None else Proof.read(row.proof),
        proof_wait=None if row.proof_wait is None else ProofWait.read(row.proof_wait),
        position=None if row.position is None else _POSITION.validate_json(row.position),
    )


def _ms(moment: datetime | None) -> int | None:
    return None if moment is None else moment_to_ms(moment)


def _moment(moment_ms: int | None) -> datetime | None:
    return None if moment_ms is None else ms_to_moment(moment_ms)


def mission_row(mission: FlownMission) -> Values:
    """The row of a mission that has no reports yet."""
    return {
        "mission_id": mission.mission_id,
        "delivery_id": mission.delivery_id,
        "attempt": mission.attempt,
        "trip": mission.trip,
        "report_seq": 0,
        "currency": mission.price.currency,
        "promised_on": conditions_of(mission).model_dump_json(exclude_none=True),
        **_mission_values(mission),
    }


def _mission_values(mission: FlownMission) -> Values:
    """The columns of a mission that change during its life.

    A mission gets another drone, also another provider's, only while it waits in a calendar.
    Its price falls when its drone loads packages of other deliveries too.
    """
    return {
        "state": mission.state,
        "start_ms": moment_to_ms(mission.booked_start_at),
        "price_amount": mission.price.amount,
        "charged_amount": None if mission.charged is None else mission.charged.amount,
        "provider_id": mission.provider_id,
        "drone_id": mission.drone_id,
        "body": mission.model_dump_json(),
    }


def mission_changes(before: FlownMission, after: FlownMission) -> Values:
    """The columns in which a mission differs; only the state, unless it has a new plan."""
    if after.model_copy(update={"state": before.state}) == before:
        return {"state": after.state}
    return _mission_values(after)


def mission_of(row: AnyRow) -> FlownMission:
    """The mission in a row."""
    return FlownMission.read(row.body).model_copy(update={"state": row.state})


def reported(report: MissionReport) -> Values:
    """What a mission's row stores of a report: its number, the times flown, the mission's end."""
    flown = report.data.get("flown", {}) if report.kind == "DELIVERED" else {}
    names = ("flight_s", "waiting_s", "recharging_s")
    ended = {"ended_ms": moment_to_ms(report.at)} if report.kind == "ENDED" else {}
    times = {name: flown[name] for name in names if name in flown}
    return {"report_seq": report.seq, **times, **ended}
