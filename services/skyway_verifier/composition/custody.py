"""The rules of custody: each package has one custodian, one chain, and one delivery.

No drone hands packages over sooner than it can fly there.
"""

import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

from skyway_composition.missions.following.plausibility import shortest_flight
from skyway_composition.tables import (
    cancellations,
    custody,
    drone_links,
    guests,
    is_open,
    mission_steps,
    missions,
    stations,
)
from sqlalchemy import and_, exists, func, or_, select

from skyway.contracts.candidate import Candidate
from skyway.contracts.mission import Cancellation
from skyway.geo import Position, distance_m
from skyway_verifier.composition.calendars import owners
from skyway_verifier.composition.steps import step_json
from skyway_verifier.finders import each_where, readable, rows_where
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import later_than

_link = custody.alias("link")
_previous = custody.alias("previous")
_following = custody.alias("following")
_name = _link.c.delivery_id + "/" + _link.c.package_id
_is_same_package = and_(
    _previous.c.delivery_id == _link.c.delivery_id, _previous.c.package_id == _link.c.package_id
)
_is_last = ~exists().where(
    _following.c.delivery_id == _link.c.delivery_id,
    _following.c.package_id == _link.c.package_id,
    _following.c.seq > _link.c.seq,
)

#: Moments are stored in whole milliseconds.
_ROUNDING_MS: Final = 1.0

_ASK_PEOPLE: Final = (
    "Ask people where the package is: at its station, with its drone or with its recipient. Then "
    "correct the last row of `custody`, and notify the customer."
)
_TWO_DRONES: Final = (
    "Two drones have taken the same package, or drones carry packages that were mixed up. Hold "
    "both missions (POST /v1/missions/{id}/commands with HOLD), ask the provider what each drone "
    "carries, and bring the wrong package back."
)


@dataclass(slots=True)
class PackageStory:
    """A package of a delivery: its chain, and the missions that were to carry it."""

    chain: list[Any] = field(default_factory=list)  # rows of custody, in order
    pickups: set[str] = field(default_factory=set)
    goals: set[str] = field(default_factory=set)
    #: Missions that were given up: a late hand-over by their drone is recorded without its step.
    given_up: set[str] = field(default_factory=set)
    #: (mission, station) of each hand-over to a recipient that a drone has reported.
    handed_over: list[tuple[str, str]] = field(default_factory=list)

    @property
    def delivered(self) -> list[Any]:  # rows of custody
        """The link to its recipient, if it has one."""
        return [row for row in self.chain if row.custodian_kind == "RECIPIENT"][:1]


async def package_stories(survey: Survey) -> Mapping[tuple[str, str], PackageStory]:
    """All packages by delivery and package, with what the missions and drones say of them."""
    found: dict[tuple[str, str], PackageStory] = defaultdict(PackageStory)
    chains = select(custody).order_by(custody.c.delivery_id, custody.c.package_id, custody.c.seq)
    async for row in survey.each(chains):
        found[row.delivery_id, row.package_id].chain.append(row)
    owner_of, delivery_of = await survey.once(owners), dict[str, str]()
    columns = (
        missions.c[name] for name in ("mission_id", "delivery_id", "request", "aims", "state")
    )
    async for row in survey.each(select(*columns)):
        delivery_of[row.mission_id] = row.delivery_id
        for package_id, (pickup, goals) in (readable(None, _requested, row) or {}).items():
            owner = owner_of.get((row.mission_id, package_id), (row.delivery_id, package_id))
            if owner is not None:
                found[owner].pickups.add(pickup)
                found[owner].goals |= goals
                if row.state in ("ABORTED", "CANCELLED", "REFUSED"):
                    found[owner].given_up.add(row.mission_id)
    done = mission_steps.c.status != "PLANNED", mission_steps.c.kind == "DELIVER"
    async for row in survey.each(select(mission_steps).where(*done)):
        step = step_json(row) or {}
        for package_id in _handed_over(row, step):
            alone = delivery_of.get(row.mission_id, ""), package_id
            owner = owner_of.get((row.mission_id, package_id), alone)
            if owner is not None:
                place = row.mission_id, step.get("station_id", "")
                found[owner].handed_over.append(place)
    return found


def _handed_over(row: Any, step: Mapping[str, Any]) -> Iterable[str]:
    """The packages that a DELIVER has handed over. Any: a row of mission_steps, and JSON.

    A step that failed has handed over those that had their proofs; its event names them.
    """
    event = readable(None, json.loads, row.event or "") or {}
    if row.status == "ENDED":
        return () if event.get("code") == "CUT" else step.get("package_ids", ())
    has_waited = step.get("verification") and event.get("code") == "RECIPIENT_ABSENT"
    return event.get("package_ids", ()) if has_waited else ()


def _requested(row: Any) -> dict[str, tuple[str, set[str]]]:  # a row of missions
    """By package of a mission: its pickup, and where it may be delivered."""
    request, aims = json.loads(row.request), json.loads(row.aims)
    found = {}
    for each in request["packages"]:
        aimed = (aim for aim in aims if aim["package_id"] == each["package_id"])
        places = each["destination"], each.get("alternative"), *aimed
        goals = {place["station_id"] for place in places if place}
        found[each["package_id"]] = request["pickup"]["station_id"], goals
    return found


def _begins_elsewhere(story: PackageStory) -> bool:
    first = story.chain[0] if story.chain else None
    is_at_pickup = (
        first and first.custodian_kind == "STATION" and first.custodian_id in story.pickups
    )
    return bool(story.pickups) and not is_at_pickup


def _has_impossible_link(story: PackageStory) -> bool:
    """Only a drone moves a package: between two links of stations or recipients is a drone."""
    return any(
        (before.custodian_kind == "DRONE") == (after.custodian_kind == "DRONE")
        and not _is_late_hand_over(story, before, after)
        for before, after in pairwise(story.chain)
    )


def _is_late_hand_over(story: PackageStory, before: Any, after: Any) -> bool:
    """Whether a drone handed over what counted as stranded since its mission was given up.

    Any: rows of custody. The same mission must have loaded the package before.
    """
    return (
        after.custodian_kind == "RECIPIENT"
        and after.mission_id in story.given_up
        and before.mission_id == after.mission_id
        and before.seq > 1
    )


def _is_handed_over_elsewhere(story: PackageStory) -> bool:
    """Whether a drone has handed it over of whose mission the chain knows no delivery."""
    by = {each.mission_id for each in story.delivered}
    return not {mission_id for mission_id, _ in story.handed_over} <= by


_DELIVERED: Final = (
    select(custody, cancellations.c.answer)
    .join(cancellations, cancellations.c.delivery_id == custody.c.delivery_id)
    .where(custody.c.custodian_kind == "RECIPIENT")
)


async def _carried_by_two(survey: Survey) -> list[str]:
    """Packages that two drones report on board."""
    of_delivery = {
        row.mission_id: row.delivery_id
        for row in await survey.rows(select(missions.c.mission_id, missions.c.delivery_id))
    }
    query = select(drone_links.c.state).where(drone_links.c.is_occupied)
    states = [json.loads(row.state or "{}") for row in await survey.rows(query)]
    owner_of = await survey.once(owners)
    carried = Counter(
        "/".join(owner_of.get((mission_id, package_id)) or (of_delivery[mission_id], package_id))
        for state in states
        if (mission_id := state.get("mission_id")) in of_delivery
        for package_id in state.get("package_ids", ())
    )
    return [package for package, drones in carried.items() if drones > 1]


async def _too_fast(survey: Survey) -> list[str]:
    position_of = {
        row.station_id: Position(row.longitude_deg, row.latitude_deg)
        async for row in survey.each(select(stations))
    }
    links: dict[str, list[Any]] = defaultdict(list)
    of_trips = select(custody).where(custody.c.custodian_kind.in_(("DRONE", "RECIPIENT")))
    async for link in survey.each(of_trips.order_by(custody.c.at_ms, custody.c.seq)):
        links[link.mission_id].append(link)
    columns = select(missions.c.mission_id, missions.c.candidate, missions.c.request)
    return [
        row.mission_id
        async for row in survey.each(columns)
        if readable(False, _is_too_fast, row, links[row.mission_id], position_of)
    ]


def _is_too_fast(
    row: Any,  # a row of missions
    links: Iterable[Any],  # its rows of custody: its drone loads at the pickup, and delivers
    position_of: Mapping[str, Position],
) -> bool:
    model, pickup = Candidate.read(row.candidate).model, json.loads(row.request)["pickup"]
    places = (
        (each.at_ms, pickup["station_id"] if each.custodian_kind == "DRONE" else each.custodian_id)
        for each in links
    )
    known = [(at_ms, position_of[place]) for at_ms, place in places if place in position_of]
    return any(
        after_ms - before_ms
        < shortest_flight(distance_m(before, after), model).total_seconds() * 1000 - _ROUNDING_MS
        for (before_ms, before), (after_ms, after) in pairwise(known)
    )


CUSTODY: Final = (
    Rule(
        "I6 a drone has had or handed over its packages in the past",
        later_than(lambda survey: survey.fleet_ms, [custody.c.at_ms], custody.c.seq > 1),
        "Set `at_ms` to `ended_at` of the drone's event (`mission_steps.event`).",
    ),
    Rule(
        "I6 a chain of custody has no gaps",
        select(_name).where(
            _link.c.seq > 1,
            ~exists().where(_is_same_package, _previous.c.seq == _link.c.seq - 1),
        ),
        "A row of `custody` was deleted. The gateway has the same chain (its table `custody`): "
        "copy the missing row from there.",
    ),
    Rule(
        "I6 a chain of custody begins at the pickup",
        each_where(package_stories, _begins_elsewhere),
        "The first row of `custody` was deleted or changed: it names the pickup station of the "
        "request, with `seq` 1.",
    ),
    Rule(
        "I6 packages pass from station to drone and from drone to station or recipient",
        each_where(package_stories, _has_impossible_link),
        _ASK_PEOPLE,
    ),
    Rule(
        "I6 a package is delivered once",
        select(custody.c.package_id)
        .where(custody.c.custodian_kind == "RECIPIENT")
        .group_by(custody.c.delivery_id, custody.c.package_id)
        .having(func.count() > 1),
        _ASK_PEOPLE + " Make the index `custody_delivered` again.",
    ),
    Rule(
        "I6 nothing follows the recipient",
        select(_link.c.package_id).join(
            _previous,
            and_(
                _is_same_package,
                _previous.c.seq < _link.c.seq,
                _previous.c.custodian_kind == "RECIPIENT",
            ),
        ),
        _ASK_PEOPLE,
    ),
    Rule(
        "I6 a package is delivered at its destination, or where its mission was aimed",
        each_where(
            package_stories,
            lambda story: any(each.custodian_id not in story.goals for each in story.delivered),
        ),
        _ASK_PEOPLE,
    ),
    Rule(
        "I6 a delivery in a chain of custody has a drone's event as evidence",
        each_where(
            package_stories,
            lambda story: any(
                each.mission_id not in story.given_up
                and (each.mission_id, each.custodian_id) not in story.handed_over
                for each in story.delivered
            ),
        ),
        "No DELIVER step of the mission ended at this station with this package. " + _ASK_PEOPLE,
    ),
    Rule(
        "I6 a package is handed over by one mission",
        each_where(package_stories, _is_handed_over_elsewhere),
        "A drone has reported a hand-over that the chain of custody does not have: two drones may "
        "have delivered the package. " + _ASK_PEOPLE,
    ),
    Rule(
        "I6 a package is on board of one drone",
        _carried_by_two,
        _TWO_DRONES,
    ),
    Rule(
        "I6 the drone that has a package is the drone of its mission",
        select(_name)
        .join(missions, missions.c.mission_id == _link.c.mission_id)
        .where(
            or_(
                and_(
                    missions.c.delivery_id != _link.c.delivery_id,
                    ~exists().where(
                        guests.c.host_id == missions.c.mission_id,
                        guests.c.delivery_id == _link.c.delivery_id,
                    ),
                ),
                and_(
                    _link.c.custodian_kind == "DRONE",
                    _link.c.custodian_id != missions.c.drone_id,
                ),
            )
        ),
        _TWO_DRONES,
    ),
    Rule(
        "I6 a mission that ended well has nothing on board",
        select(_name)
        .join(missions, missions.c.mission_id == _link.c.mission_id)
        .where(
            _link.c.custodian_kind == "DRONE",
            _is_last,
            missions.c.state.in_(("COMPLETED", "CANCELLED", "REFUSED")),
        ),
        "The drone still carries the package of a mission that is over. Set the mission's state "
        "back if the drone flies it; else ask the provider to bring the package back.",
    ),
    Rule(
        "I6 a package that a cancellation released is not delivered",
        rows_where(
            _DELIVERED,
            lambda row: row.package_id in Cancellation.read(row.answer).released,
            *("delivery_id", "package_id"),
        ),
        "The customer was notified that the package stays, but it was delivered. Notify the "
        "customer; the alarm FLIES_ON may say more.",
    ),
    Rule(
        "I6 a package of a live mission has a chain of custody",
        select(missions.c.mission_id).where(
            is_open, ~exists().where(custody.c.delivery_id == missions.c.delivery_id)
        ),
        "All rows of the chain were deleted. The gateway has the same chain (its table "
        "`custody`): copy the rows from there.",
    ),
    Rule(
        "I6 no drone hands packages over sooner than it can fly there",
        _too_fast,
        "The drone cannot have been at both stations at these moments: it was believed wrongly, or "
        "a row of `custody` was changed. Ask people where the packages are, and do not pay the "
        "mission before they have answered.",
    ),
)
