"""One example of each delivery event, as the generated documents show it."""

from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Any, Final

from pydantic import TypeAdapter

from skyway.contracts.delivery_event_forms import AnyDeliveryEvent
from skyway.contracts.instruction_examples import (
    DELIVERY,
    MCQUEENEY,
    MISSION,
    SAN_MARCOS,
    TRACEPARENT,
    after,
)
from skyway.contracts.message import utc_text

_FLOWN_BY: Final = {"mission_id": MISSION, "provider_id": "prv_01", "drone_id": "drn_01"}
_ON_BOARD: Final = {"load_before_kg": 0.0, "load_after_kg": 2.0}
_WITH_RECIPIENT: Final = {"kind": "RECIPIENT", "id": MCQUEENEY}
_AT_PICKUP: Final = {"kind": "STATION", "id": SAN_MARCOS}
_NO_REASON: Final[dict[str, None]] = {"code": None, "detail": None}
_CANCELLED: Final = {"code": "CANCELLED", "detail": "the book is out of print"}
_LOW: Final = {"code": "BATTERY_LOW", "detail": "the battery is below the plan by 0.06"}
_PROMISED: Final = utc_text(after(29))
_P90: Final = utc_text(after(32))
_LATER: Final = utc_text(after(35))


def delivery_event_examples() -> list[AnyDeliveryEvent]:
    """The examples, in the order in which these events can come."""
    adapter: TypeAdapter[AnyDeliveryEvent] = TypeAdapter(AnyDeliveryEvent)
    return [
        adapter.validate_python(
            {
                "message_id": f"msg_{sequence + 20}",
                "sent_at": utc_text(at),
                "traceparent": TRACEPARENT,
                "event_id": f"evt_{sequence:02}",
                "type": kind,
                "delivery_id": DELIVERY,
                "sequence": sequence,
                "occurred_at": utc_text(at),
                "data": data,
            }
        )
        for sequence, (kind, at, data) in enumerate(_examples(), start=1)
    ]


def _examples() -> Iterator[tuple[str, datetime, Mapping[str, Any]]]:
    yield "delivery.requested", after(0), _requested()
    yield "delivery.scheduled", after(0), _scheduled()
    yield "delivery.planned", after(0), _planned()
    yield "delivery.promised", after(1), {"packages": _planned()["packages"]}
    yield "delivery.changed", after(0), _changed()
    yield "delivery.dispatched", after(1), _FLOWN_BY
    yield "delivery.loaded", after(5), _loaded()
    yield "delivery.started", after(5), _FLOWN_BY
    yield "delivery.proof_awaited", after(29), _proof_awaited()
    yield "delivery.delayed", after(12), {"packages": [_late()]}
    yield "delivery.replanned", after(12), _replanned()
    yield "package.delivered", after(35), _delivered()
    yield "package.returned", after(50), _returned()
    yield (
        "package.stranded",
        after(50),
        {**_here("p2", "STRANDED"), **_LOW, "station_id": MCQUEENEY},
    )
    yield "package.cancelled", after(2), _cancelled()
    yield "delivery.completed", after(35), _completed()
    yield "delivery.partially_completed", after(50), _ended("DELIVERED", "RETURNED", _LOW)
    yield "delivery.failed", after(50), _ended("RETURNED", "RETURNED", _LOW)
    yield "delivery.rejected", after(1), _rejected()
    yield "delivery.cancelled", after(2), _ended("CANCELLED", "CANCELLED", _CANCELLED)


def _requested() -> Mapping[str, Any]:
    packages = [
        {"package_id": name, "mass_kg": mass_kg, "destination": {"station_id": MCQUEENEY}}
        for name, mass_kg in (("p1", 0.8), ("p2", 1.2))
    ]
    request = {"pickup": {"station_id": SAN_MARCOS}, "packages": packages}
    return {"reference": "order 1042", "request": request}


def _changed() -> Mapping[str, Any]:
    return {"changed": ["instructions"], "reference": "order 1042", "request": None}


def _scheduled() -> Mapping[str, Any]:
    day = 24 * 60
    return {
        "earliest_pickup_at": utc_text(after(3 * day)),
        "books_from_at": utc_text(after(2 * day)),
    }


_PRICE: Final = {
    "amount": 1340,
    "currency": "USD",
    "line_items": [{"kind": "BASE", "amount": 500}, {"kind": "DISTANCE", "amount": 840}],
}


def _planned() -> Mapping[str, Any]:
    return {
        "attempt": 1,
        "provider_id": "prv_01",
        "drone_id": "drn_01",
        "mission_ids": [MISSION],
        "price": _PRICE,
        "pickup_station_id": SAN_MARCOS,
        "pickup_at": utc_text(after(5)),
        "delivery_time_s": 1440.0,
        "packages": [
            {"package_id": name, "eta_at": _PROMISED, "eta_p90_at": _P90, "due_at": _P90}
            for name in ("p1", "p2")
        ],
        "waiting_package_ids": [],
    }


def _loaded() -> Mapping[str, Any]:
    return {
        **_FLOWN_BY,
        "station_id": SAN_MARCOS,
        "package_ids": ["p1", "p2"],
        "is_pooled": False,
        "price": _PRICE,
        "evidence": _ON_BOARD,
    }


def _late() -> Mapping[str, Any]:
    return {
        "package_id": "p1",
        "promised_at": _PROMISED,
        "due_at": _P90,
        "eta_at": _LATER,
        "late_s": 180.0,
        "deadline_at": None,
    }


def _replanned() -> Mapping[str, Any]:
    package = {
        "package_id": "p1",
        "state": "ON_BOARD",
        "eta_at": _LATER,
        "promised_at": _PROMISED,
        "due_at": _P90,
        "later_s": 360.0,
    }
    return {**_FLOWN_BY, **_LOW, "revision": 2, "given_up": None, "packages": [package]}


def _proof_awaited() -> Mapping[str, Any]:
    waiting = {"package_id": "p1", "method": "PIN"}
    return {
        **_FLOWN_BY,
        "station_id": MCQUEENEY,
        "packages": [waiting],
        "until_at": utc_text(after(34)),
    }


def _delivered() -> Mapping[str, Any]:
    return {
        **_FLOWN_BY,
        "package_id": "p1",
        "station_id": MCQUEENEY,
        "delivered_at": _LATER,
        "evidence": {"load_before_kg": 2.0, "load_after_kg": 1.2},
    }


def _returned() -> Mapping[str, Any]:
    return {
        **_FLOWN_BY,
        **_LOW,
        "package_id": "p2",
        "station_id": SAN_MARCOS,
        "returned_at": utc_text(after(50)),
        "evidence": {"load_before_kg": 1.2, "load_after_kg": 0.0},
    }


def _cancelled() -> Mapping[str, Any]:
    return {
        **_CANCELLED,
        "package_id": "p1",
        "station_id": SAN_MARCOS,
        "custodian": _AT_PICKUP,
    }


def _completed() -> Mapping[str, Any]:
    return {
        "price": _PRICE,
        "planned": {"completed_at": _PROMISED, "delivery_time_s": 1440.0},
        "actual": {"completed_at": _LATER, "delivery_time_s": 1800.0},
        "packages": [
            {
                "package_id": name,
                "promised_at": _PROMISED,
                "due_at": _P90,
                "delivered_at": _LATER,
            }
            for name in ("p1", "p2")
        ],
    }


def _ended(first: str, second: str, why: Mapping[str, Any]) -> Mapping[str, Any]:
    packages = []
    for name, state in (("p1", first), ("p2", second)):
        is_delivered = state == "DELIVERED"
        at = {"delivered_at": _LATER if is_delivered else None}
        packages.append({**_here(name, state), **(_NO_REASON if is_delivered else why), **at})
    return {"price": _PRICE, **why, "packages": packages}


def _here(package_id: str, state: str) -> dict[str, Any]:
    custodian = {
        "DELIVERED": _WITH_RECIPIENT,
        "STRANDED": {"kind": "STATION", "id": MCQUEENEY},
    }.get(state, _AT_PICKUP)
    return {"package_id": package_id, "state": state, "custodian": custodian, "position": None}


def _rejected() -> Mapping[str, Any]:
    reason = {
        "provider_id": "prv_01",
        "code": "OVERWEIGHT",
        "detail": "payload 17.2 kg exceeds the 2.7 kg limit of the heaviest lifter",
        "is_temporary": False,
        "data": {"mass_kg": 17.2, "limit_kg": 2.7},
    }
    return {"detail": "no provider can fly this request", "reasons": [reason]}
