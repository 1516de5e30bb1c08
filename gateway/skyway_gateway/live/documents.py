"""Shapes what the services answer, and the gateway's own deliveries, for the picture."""

import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any, Final

from pydantic_core import to_jsonable_python

from skyway.geo import Box, Position, bearing_rad, distance_m
from skyway.ids import DeliveryId
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.live.picture import FLEETS, OPERATORS, Item, JsonObject, Key, Readers

#: Members that become keys, or are for the gateway alone.
_OUTSIDE_OF_MISSION: Final = frozenset({"mission_id", "steps", "packages", "service_steps"})
#: The audience of tracking links: the name of no customer.
_LINK: Final = "link/"
#: The audience of all providers, where operators see more.
_PROVIDERS: Final = "providers/"
#: What a customer sees of a mission beside its steps and packages.
_OF_MISSION_FOR_CUSTOMERS: Final = ("delivery_id", "provider_id", "state", "revision")
_OF_STEP_FOR_CUSTOMERS: Final = (
    *("kind", "status", "station_id", "position", "from_position"),
    *("start_at", "end_at", "package_ids"),
)


def mission_item(mission: Mapping[str, Any], promises: JsonObject) -> tuple[Key, Item]:
    """A mission as operators and its provider see it; `mission` is a `LiveMission` as JSON.

    `promises` says when each of its packages was promised, and nothing of other packages.
    """
    document = {name: value for name, value in mission.items() if name not in _OUTSIDE_OF_MISSION}
    document["packages"] = {each["package_id"]: each["eta_at"] for each in mission["packages"]}
    if promises:
        document["promises"] = promises
    document["steps"] = {
        str(step["step_id"]): {name: value for name, value in step.items() if name != "step_id"}
        for step in mission["steps"]
    }
    readers = Readers(operators=True, provider_id=mission["provider_id"])
    bounds = _around(step["position"] for step in mission["steps"])
    return Key("missions", mission["mission_id"]), Item(document, readers, bounds)


def customers_mission(mission: Mapping[str, Any], customer_id: str) -> tuple[Key, Item]:
    """What a customer sees of a mission: its part of the way, and not the drone's way home."""
    own = mission["steps"][: mission["service_steps"]]
    document = {name: mission[name] for name in _OF_MISSION_FOR_CUSTOMERS}
    document["packages"] = {each["package_id"]: each["eta_at"] for each in mission["packages"]}
    document["steps"] = {
        str(step["step_id"]): {name: step[name] for name in _OF_STEP_FOR_CUSTOMERS if name in step}
        for step in own
    }
    key = Key("missions", mission["mission_id"], customer_id)
    return key, Item(
        document, Readers(customer_id=customer_id), _around(step["position"] for step in own)
    )


def station_item(station: Mapping[str, Any]) -> tuple[Key, Item]:
    """A station where pads are taken or reserved."""
    document = _without(station, "station_id")
    return Key("stations", station["station_id"]), Item(
        document, FLEETS, Box.around([station["position"]])
    )


def closure_item(closure: Mapping[str, Any]) -> tuple[Key, Item]:
    """A closure of any kind; without an area it is shown everywhere."""
    rings = closure.get("rings")
    bounds = _around(place for ring in rings or () for place in ring)
    if bounds is not None and not 0.0 < bounds.width_deg < 180.0:
        bounds = None  # The ring may go around a pole or the whole Earth: it is near everything.
    return Key("closures", closure["closure_id"]), Item(
        _without(closure, "closure_id"), FLEETS, bounds
    )


def alarm_item(alarm: Mapping[str, Any]) -> tuple[Key, Item]:
    """An open alarm: operators see all, a provider those about its drones."""
    readers = Readers(operators=True, provider_id=alarm.get("provider_id"))
    return Key("alarms", alarm["alarm_id"]), Item(_without(alarm, "alarm_id"), readers)


def delivery_item(delivery: Delivery) -> tuple[Key, Item]:
    """A delivery that is not over, as operators and its customer see it."""
    document: dict[str, Any] = {
        "customer_id": delivery.customer_id,
        "reference": delivery.reference,
        "state": delivery.state,
        "activity": delivery.activity,
        "is_delayed": delivery.flags.delayed,
        "is_replanning": delivery.flags.replanning,
        "is_waiting": delivery.is_queued,
        "created_at": delivery.created_at,
        "pickup": delivery.pickup,
        "mission_ids": [mission.mission_id for mission in delivery.missions],
        "packages": {
            package.package_id: {
                "state": package.state,
                "destination": package.destination,
                "promised_at": package.promised_at,
                "due_at": package.due_at,
                "eta_at": package.eta_at,
                "delivered_at": package.delivered_at,
                "code": package.code,
            }
            for package in delivery.packages
        },
    }
    readers = Readers(operators=True, customer_id=delivery.customer_id)
    shown = _without_nulls(to_jsonable_python(document))
    return Key("deliveries", delivery.delivery_id), Item(shown, readers)


def linked_delivery_item(delivery_id: DeliveryId, version: int) -> tuple[Key, Item]:
    """What a tracking page gets: that the delivery has changed, so that it reads it again."""
    readers = Readers(linked_delivery_id=delivery_id)
    return Key("deliveries", delivery_id, _LINK), Item({"version": version}, readers)


def service_items(
    name: str,
    figures: JsonObject,
    *,
    is_answering: bool,
    silent_since_at: datetime | None = None,
) -> tuple[tuple[Key, Item], tuple[Key, Item]]:
    """Whether a service answers; while it does not, its part of the picture stands still.

    Operators see its figures too.
    """
    answering: dict[str, Any] = {"is_answering": is_answering}
    if silent_since_at is not None:
        answering["silent_since_at"] = to_jsonable_python(silent_since_at)
    return (
        (Key("services", name), Item({**figures, **answering}, OPERATORS)),
        (Key("services", name, _PROVIDERS), Item(answering, Readers(all_providers=True))),
    )


def _without(members: Mapping[str, Any], name: str) -> JsonObject:
    return {each: value for each, value in members.items() if each != name}


def _without_nulls(value: Any) -> Any:  # any JSON value
    if isinstance(value, dict):
        return {name: _without_nulls(each) for name, each in value.items() if each is not None}
    return value


def _around(positions: Iterable[Sequence[float]]) -> Box | None:
    """The smallest box around these positions; None for no position."""
    places = list(positions)
    return Box.around(places) if places else None


#: About a decimetre; finer digits would be noise, and would be sent again and again.
_DEGREE_DIGITS: Final = 6
_SOC_DIGITS: Final = 4
#: A drone that has moved less keeps its heading, metres.
_LEAST_MOVE_M: Final = 2.0

#: What a customer sees of a drone.
_FOR_CUSTOMERS: Final = ("position", "heading_deg", "at", "activity", "mission_id")


def drone_item(
    drone: Mapping[str, Any], before: Item | None, mission: JsonObject | None
) -> tuple[Key, Item]:
    """A drone as operators and its provider see it.

    `drone` is a `LiveDrone` as JSON, `before` the item that it replaces, and `mission` the document
    of its mission.
    """
    document = {name: value for name, value in drone.items() if name != "drone_id"}
    longitude_deg, latitude_deg = drone["position"]
    position = [round(longitude_deg, _DEGREE_DIGITS), round(latitude_deg, _DEGREE_DIGITS)]
    document |= {"position": position, "soc": round(drone["soc"], _SOC_DIGITS)}
    heading_deg = _heading_deg(position, None if before is None else before.document)
    if heading_deg is not None:
        document["heading_deg"] = heading_deg
    landing = None if mission is None else _next_landing(mission)
    if landing is not None and document.get("activity") == "FLYING":
        document["next_landing"] = landing
    readers = Readers(operators=True, provider_id=drone["provider_id"])
    return Key("drones", drone["drone_id"]), Item(document, readers, Box.around([position]))


def customers_drone(drone: Item, mission: JsonObject, key: Key) -> Item | None:
    """What a customer sees of a drone: its place, while it carries packages of the customer.

    The delivery's tracking page shows the same.
    `mission` is the mission as operators see it, `key` the key of the customer's own item of it.
    """
    document = drone.document
    flown_as = mission.get("flown_as", key.item_id)
    if not mission["is_carrying"] or document.get("mission_id") != flown_as:
        return None
    shown = {name: document[name] for name in _FOR_CUSTOMERS if name in document}
    # A guest's customer knows the mission by the guest's own id.
    shown["mission_id"] = key.item_id
    readers = Readers(customer_id=key.audience, linked_delivery_id=mission["delivery_id"])
    return Item(shown, readers, drone.bounds)


def _heading_deg(position: list[float], before: JsonObject | None) -> int | None:
    """Clockwise from north, from the drone's last two places; None before it has moved."""
    if before is None:
        return None
    start, end = Position(*before["position"]), Position(*position)
    if distance_m(start, end) < _LEAST_MOVE_M:
        return before.get("heading_deg")
    return round(math.degrees(bearing_rad(start, end))) % 360


def _next_landing(mission: JsonObject) -> dict[str, str] | None:
    """Where and when the plan lands next."""
    for step in mission["steps"].values():
        if step["status"] == "PLANNED" and step.get("lands"):
            return {"station_id": step["station_id"], "at": step["end_at"]}
    return None
