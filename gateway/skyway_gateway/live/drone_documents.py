"""Shapes what the registry answers about drones for the picture."""

import math
from collections.abc import Mapping
from typing import Any, Final

from skyway.geo import Box, Position, bearing_rad, distance_m
from skyway_gateway.live.merge_patch import JsonObject
from skyway_gateway.live.picture import Item, Key, Readers

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
