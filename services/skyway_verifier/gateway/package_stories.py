"""What the database says of each package: its chain of custody, and the events about its end."""

import json
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final

from skyway_gateway.deliveries.lifecycle.delivery import SETTLED_PACKAGE_STATES
from skyway_gateway.delivery_tables import custody, deliveries, missions, packages
from skyway_gateway.tables import events
from sqlalchemy import and_, select

from skyway.units import moment_to_ms
from skyway_verifier.rule import Survey

#: The end of a package, as its event and as its row say: event type, station, moment, mission.
End = tuple[str, str | None, int | None, str | None]

_ENDS: Final = {f"package.{state.lower()}": state for state in SETTLED_PACKAGE_STATES}


@dataclass(slots=True)
class PackageStory:
    """A package, its links in order, and where it may go.

    `is_brought` says that its customer brought it to the pickup of one of its missions, which is
    within the distance that the request allows: this station is its second link.
    """

    pickup: str
    goals: set[str]
    drones: set[str]
    expected_ends: list[End]
    kinds: list[str] = field(default_factory=list)
    custodians: list[str] = field(default_factory=list)
    notified_ends: list[End] = field(default_factory=list)
    is_brought: bool = False


_first = custody.alias("first")
_second = custody.alias("second")

#: Packages that moved from one station to another without a drone, with each mission of their
#: deliveries.
_MOVED: Final = (
    select(
        _second.c.delivery_id,
        _second.c.package_id,
        _second.c.custodian_id,
        deliveries.c.request,
        missions.c.body,
    )
    .join(
        _first,
        and_(
            _first.c.delivery_id == _second.c.delivery_id,
            _first.c.package_id == _second.c.package_id,
            _first.c.seq == 1,
            _first.c.custodian_kind == "STATION",
        ),
    )
    .join(deliveries, deliveries.c.delivery_id == _second.c.delivery_id)
    .join(missions, missions.c.delivery_id == _second.c.delivery_id)
    .where(_second.c.seq == 2, _second.c.custodian_kind == "STATION")
)


async def package_stories(survey: Survey) -> Mapping[tuple[str, str], PackageStory]:
    """All packages by delivery and package."""
    stories = await _stories(survey)
    links = select(custody).order_by(custody.c.delivery_id, custody.c.package_id, custody.c.seq)
    async for row in survey.each(links):
        story = stories.get((row.delivery_id, row.package_id))
        if story is not None:
            story.kinds.append(row.custodian_kind)
            story.custodians.append(row.custodian_id)
    async for row in survey.each(_MOVED):
        story = stories.get((row.delivery_id, row.package_id))
        if story is not None and _allows_pickup(row):
            story.is_brought = True
    ends = select(events.c.delivery_id, events.c.type, events.c.body)
    async for row in survey.each(ends.where(events.c.type.in_(sorted(_ENDS)))):
        data = json.loads(row.body)["data"]
        story = stories.get((row.delivery_id, data["package_id"]))
        if story is not None:
            story.notified_ends.append(_notified(row.type, data))
    return stories


async def _stories(survey: Survey) -> dict[tuple[str, str], PackageStory]:
    """The packages without their links and events."""
    drones: dict[str, set[str]] = defaultdict(set)
    async for row in survey.each(select(missions.c.delivery_id, missions.c.drone_id)):
        drones[row.delivery_id].add(row.drone_id)
    query = select(packages, deliveries.c.request, deliveries.c.state.label("delivery_state")).join(
        deliveries, deliveries.c.delivery_id == packages.c.delivery_id
    )
    found: dict[tuple[str, str], PackageStory] = {}
    async for row in survey.each(query):
        request = json.loads(row.request)
        found[row.delivery_id, row.package_id] = PackageStory(
            pickup=request["pickup"]["station_id"],
            goals=_goals(request, row.package_id),
            drones=drones[row.delivery_id],
            expected_ends=_expected(row),
        )
    return found


def _allows_pickup(row: Any) -> bool:  # a row of _MOVED
    """Whether the mission has this station as its pickup, and the request allows it."""
    request, mission = json.loads(row.request), json.loads(row.body)
    if mission.get("pickup_station_id") != row.custodian_id:
        return False
    within_m = request["qos"].get("pickup_within_m", 0.0)
    is_other = row.custodian_id != request["pickup"]["station_id"]
    return is_other and bool(within_m > 0.0 and mission["pickup_away_m"] <= within_m)


def _goals(request: Mapping[str, Any], package_id: str) -> set[str]:  # JSON of a DeliveryRequest
    """The stations where a package may be handed to its recipient."""
    return {
        place["station_id"]
        for each in request["packages"]
        if each["package_id"] == package_id
        for place in (each["destination"], each["alternative"])
        if place is not None
    }


def _expected(row: Any) -> list[End]:  # a row of packages, with its delivery's state
    """The end of which the customer must have been notified; one at most."""
    if row.state not in SETTLED_PACKAGE_STATES:
        return []
    if row.delivery_state == "REJECTED":  # its one event speaks for all packages
        return []
    kind = f"package.{row.state.lower()}"
    if row.state != "DELIVERED":
        return [(kind, None, None, None)]
    return [(kind, row.custodian_id, row.delivered_ms, row.mission_id)]


def _notified(kind: str, data: Mapping[str, Any]) -> End:  # the data of an event
    if kind != "package.delivered":
        return (kind, None, None, None)
    delivered_ms = moment_to_ms(datetime.fromisoformat(data["delivered_at"]))
    return (kind, data["station_id"], delivered_ms, data["mission_id"])
