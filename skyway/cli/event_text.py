"""What a delivery event says, in one line for people."""

import json
from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any

#: Any: the JSON of an event, whose `data` depends on its type.
EventData = Mapping[str, Any]

_MINUTE_S = 60.0


def event_text(event: EventData) -> str:
    """The moment of the event in fleet time, and what has happened.

    An event of another version of the gateway, without the members that are needed, shows its JSON.
    """
    try:
        sentence = _sentence(event["type"], event["data"])
    except (KeyError, TypeError):
        sentence = f"{event['type']}  {json.dumps(event['data'])}"
    return f"{_clock(event['occurred_at'])}  {sentence}"


def _sentence(event_type: str, data: EventData) -> str:
    match event_type:
        case "delivery.requested":
            return f"requested: {_packages(data['request']['packages'])}"
        case "delivery.changed":
            return f"changed by the customer: {', '.join(data['changed'])}"
        case "delivery.scheduled":
            return f"scheduled: a drone is booked from {_clock(data['books_from_at'])} on"
        case "delivery.planned":
            pickup = f"pickup at {data['pickup_station_id']}"
            return f"planned: {pickup}, {_etas(data['packages'])}, {_price(data['price'])}"
        case "delivery.promised":
            return f"promised: {_etas(data['packages'])}"
        case "delivery.dispatched":
            return f"drone {data['drone_id']} has accepted the mission"
        case "delivery.loaded":
            price = _price(data.get("price"))
            shared = f", a shared trip for {price}" if data.get("is_pooled") else ""
            return f"loaded at {data['station_id']}: {', '.join(data['package_ids'])}{shared}"
        case "delivery.started":
            return "on its way"
        case "delivery.proof_awaited":
            until = _clock(data["until_at"])
            return f"waits at {data['station_id']} for proof of the hand-over, until {until}"
        case "delivery.delayed":
            return f"late: {_etas(data['packages'])}"
        case "delivery.replanned":
            return f"planned again{_why(data)}: {_etas(data['packages'])}"
        case "package.delivered":
            return f"{data['package_id']} delivered at {data['station_id']}"
        case "package.returned":
            return f"{data['package_id']} returned to {data['station_id']}{_why(data)}"
        case "package.stranded":
            place = data["station_id"] or "a place without a station"
            return f"{data['package_id']} left at {place}{_why(data)}"
        case "package.cancelled":
            return f"{data['package_id']} stays at {data['station_id']}{_why(data)}"
        case "delivery.completed":
            return f"COMPLETED, {_against_plan(data)}"
        case "delivery.rejected":
            return f"REJECTED: {data['detail']}"
        case _:
            return f"{event_type.removeprefix('delivery.').upper()}{_why(data)}"


def _packages(packages: Iterable[EventData]) -> str:
    return ", ".join(
        f"{each['package_id']} to {each['destination']['station_id']}" for each in packages
    )


def _etas(packages: Iterable[EventData]) -> str:
    return ", ".join(
        f"{each['package_id']} at {_clock(each['eta_at'])}"
        if each["eta_at"]
        else f"{each['package_id']} without a time"
        for each in packages
    )


def _price(price: EventData | None) -> str:
    return "no price" if price is None else f"{price['amount'] / 100:.2f} {price['currency']}"


def _against_plan(data: EventData) -> str:
    planned, actual = (
        datetime.fromisoformat(data[name]["completed_at"]) for name in ("planned", "actual")
    )
    late_s = (actual - planned).total_seconds()
    if abs(late_s) < _MINUTE_S:
        return "as planned"
    return f"{abs(late_s) / _MINUTE_S:.0f} min {'later' if late_s > 0 else 'earlier'} than planned"


def _why(data: EventData) -> str:
    detail = data.get("detail")
    return "" if not detail else f" ({detail})"


def _clock(moment: str) -> str:
    return datetime.fromisoformat(moment).strftime("%H:%M:%S")
