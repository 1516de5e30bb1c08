"""Between a delivery and its own row."""

from collections.abc import Sequence
from typing import Final

from pydantic import TypeAdapter

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import OfferLimits
from skyway.delivery.request import DeliveryRequest
from skyway.geo import Position
from skyway.runtime.sql.connection import AnyRow
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.deliveries import told
from skyway_gateway.deliveries.delivery import (
    Delivery,
    Flags,
    FlownMission,
    PackageStatus,
    Refusal,
)
from skyway_gateway.deliveries.known import Known
from skyway_gateway.deliveries.queued import Queued
from skyway_gateway.deliveries.rows.values import Values

_POSITION: Final = TypeAdapter(Position)
_REASONS: Final = TypeAdapter(tuple[ProviderReason, ...])
_REFUSALS: Final = TypeAdapter(tuple[Refusal, ...])


def new_delivery(queued: Queued) -> Values:
    """The row of a delivery that was just accepted."""
    delivery = queued.delivery
    return {
        "delivery_id": delivery.delivery_id,
        "customer_id": delivery.customer_id,
        "reference": delivery.reference,
        "request": delivery.request.model_dump_json(),
        "pickup_position": _POSITION.dump_json(queued.pickup_position).decode(),
        "created_ms": moment_to_ms(delivery.created_at),
        "give_up_ms": moment_to_ms(queued.give_up_at),
        "offer": delivery.offer and delivery.offer.model_dump_json(),
        "traceparent": queued.traceparent,
        "next_try_wall_ms": 0,
        **changing(queued.known),
    }


def reasons_text(reasons: Sequence[ProviderReason]) -> str:
    """Reasons as JSON."""
    return _REASONS.dump_json(tuple(reasons)).decode()


def changing(known: Known) -> Values:
    """The columns of a delivery that change during its life."""
    delivery = known.delivery
    return {
        "version": known.version,
        "last_sequence": known.last_sequence,
        "state": delivery.state,
        "activity": delivery.activity,
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
        price=told.price_of(flown),
        provider_id=flown[0].provider_id if flown else None,
        missions=tuple(flown),
        packages=tuple(packed),
        refusals=_REFUSALS.validate_json(row.refusals),
        reasons=_REASONS.validate_json(row.reasons),
        offer=None if row.offer is None else OfferLimits.read(row.offer),
        cancel_reason=row.cancel_reason,
    )


def known_of(row: AnyRow, delivery: Delivery) -> Known:
    """The delivery in a row, with its place in time."""
    return Known(delivery, row.version, row.last_sequence)


def queued_of(row: AnyRow, known: Known) -> Queued:
    """The queued delivery in a row."""
    return Queued(
        known=known,
        pickup_position=_POSITION.validate_json(row.pickup_position),
        give_up_at=ms_to_moment(row.give_up_ms),
        traceparent=row.traceparent,
    )
