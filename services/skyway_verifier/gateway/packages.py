"""The rules of packages: one custodian, one chain of custody, one delivery (I6)."""

import json
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

from skyway_gateway.deliveries.lifecycle.delivery import (
    ON_BOARD_STATES,
    SETTLED_PACKAGE_STATES,
    Proof,
)
from skyway_gateway.delivery_tables import custody, deliveries, missions, packages
from skyway_gateway.lateness.lateness_forecast import due_of
from skyway_gateway.lateness.store import IS_DUE_AS_PROMISED
from skyway_gateway.tables import events
from sqlalchemy import ColumnElement, and_, exists, func, not_, or_, select

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.delivery.request import DeliveryRequest
from skyway.units import moment_to_ms, ms_to_moment
from skyway_verifier.finders import any_of, differs, each_where, ms_of, readable, rows_where
from skyway_verifier.rule import Rule, Survey

#: The end of a package, as its event and as its row say: event type, station, moment, mission.
End = tuple[str, str | None, int | None, str | None]

#: The events about the plans and the ends of packages.
_EVENTS: Final = (
    *("delivery.planned", "delivery.promised"),
    *sorted(f"package.{state.lower()}" for state in SETTLED_PACKAGE_STATES),
)

_is_of_package = and_(
    custody.c.delivery_id == packages.c.delivery_id,
    custody.c.package_id == packages.c.package_id,
)
_name = packages.c.delivery_id + "/" + packages.c.package_id
_NAMES: Final = ("delivery_id", "package_id")
_is_settled = packages.c.state.in_(sorted(SETTLED_PACKAGE_STATES))
_is_delivered = packages.c.state == "DELIVERED"
_is_with_recipient = packages.c.custodian_kind == "RECIPIENT"
_is_its_mission = and_(
    missions.c.mission_id == packages.c.mission_id,
    missions.c.delivery_id == packages.c.delivery_id,
)
_is_live = missions.c.state.in_(LIVE_MISSION_STATES)

#: The states in which each custodian may have a package.
_MAY_HAVE: Final = {
    "STATION": ("CREATED", "RETURNED", "STRANDED", "CANCELLED"),
    "DRONE": (*sorted(ON_BOARD_STATES), "STRANDED"),
    "RECIPIENT": ("DELIVERED",),
}

_FROM_COMPOSITION: Final = (
    "Composition has the same chain (its table `custody`), with the mission of each link: correct "
    "the rows here by it. If both differ from what people see, ask people where the package is."
)
_FROM_EVENTS: Final = (
    "The customer was notified of something else: see the delivery's events. Composition's "
    "`custody` and the drone's event (`mission_steps.event`) say what happened; correct the row, "
    "or notify the customer yourself if the events are wrong."
)


@dataclass(slots=True)
class PackageStory:
    """A package, its links in order, where it may go, and what its customer was notified of.

    `is_brought` says that its customer brought it to the pickup of one of its missions, which is
    within the distance that the request allows: this station is its second link. `planned` and
    `delivered` are members of the last events about its plan and its hand-over.
    """

    row: Any  # of packages, with its delivery's request and state
    asked: tuple[str, set[str]] | None  # pickup and goals; None if the request cannot be read
    drones: set[str]
    links: list[tuple[str, str]] = field(default_factory=list)  # kind and id of each custodian
    ends: list[End] = field(default_factory=list)
    planned: Mapping[str, Any] = field(default_factory=dict)
    delivered: Mapping[str, Any] = field(default_factory=dict)
    is_brought: bool = False

    def had_by(self, kind: str) -> set[str]:
        """The custodians of a kind that had it."""
        return {custodian_id for each, custodian_id in self.links if each == kind}


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
    drones: dict[str, set[str]] = defaultdict(set)
    async for row in survey.each(select(missions.c.delivery_id, missions.c.drone_id)):
        drones[row.delivery_id].add(row.drone_id)
    query = select(packages, deliveries.c.request, deliveries.c.state.label("delivery_state")).join(
        deliveries, deliveries.c.delivery_id == packages.c.delivery_id
    )
    found: dict[tuple[str, str], PackageStory] = {}
    async for row in survey.each(query):
        asked = readable(None, _asked, row)
        found[row.delivery_id, row.package_id] = PackageStory(row, asked, drones[row.delivery_id])
    links = select(custody).order_by(custody.c.delivery_id, custody.c.package_id, custody.c.seq)
    async for row in survey.each(links):
        if (story := found.get((row.delivery_id, row.package_id))) is not None:
            story.links.append((row.custodian_kind, row.custodian_id))
    async for row in survey.each(_MOVED):
        if (story := found.get((row.delivery_id, row.package_id))) is not None:
            story.is_brought |= readable(False, _allows_pickup, row)
    of_packages = select(events).where(events.c.type.in_(_EVENTS))
    async for row in survey.each(of_packages.order_by(events.c.sequence)):
        _notify(found, row, json.loads(row.body)["data"])
    return found


def _notify(
    stories: Mapping[tuple[str, str], PackageStory],
    event: Any,  # a row of events
    data: Mapping[str, Any],  # of the event's body
) -> None:
    """Add an event to the stories of its packages."""
    is_plan = event.type in ("delivery.planned", "delivery.promised")
    for each in data["packages"] if is_plan else [data]:
        story = stories.get((event.delivery_id, each["package_id"]))
        if story is None:
            continue
        if is_plan:
            story.planned = each
        elif event.type == "package.delivered":
            story.delivered = data
            moment_ms = ms_of(data["delivered_at"])
            story.ends.append((event.type, data["station_id"], moment_ms, data["mission_id"]))
        else:
            story.ends.append((event.type, None, None, None))


def _asked(row: Any) -> tuple[str, set[str]]:  # a row of packages
    """Where its request wants it to be picked up and handed over."""
    request = json.loads(row.request)
    asked = (each for each in request["packages"] if each["package_id"] == row.package_id)
    places = (place for each in asked for place in (each["destination"], each["alternative"]))
    goals = {place["station_id"] for place in places if place is not None}
    return request["pickup"]["station_id"], goals


def _allows_pickup(row: Any) -> bool:  # a row of _MOVED
    """Whether the mission has this station as its pickup, and the request allows it."""
    request, mission = json.loads(row.request), json.loads(row.body)
    if mission.get("pickup_station_id") != row.custodian_id:
        return False
    within_m = request["qos"].get("pickup_within_m", 0.0)
    is_other = row.custodian_id != request["pickup"]["station_id"]
    return is_other and bool(within_m > 0.0 and mission["pickup_away_m"] <= within_m)


def _link_count(*conditions: ColumnElement[bool]) -> ColumnElement[int]:
    statement = select(func.count()).where(_is_of_package, *conditions)
    return statement.correlate(packages).scalar_subquery()


def _has_impossible_link(story: PackageStory) -> bool:
    """Only a drone moves a package: of two links that follow one another, one is a drone's.

    Before that, its customer may bring it to another station that the request allows.
    """
    links = story.links[1:] if story.is_brought else story.links
    flew = [kind == "DRONE" for kind, _ in links]
    return any(before == after for before, after in pairwise(flew))


def _ends_otherwise_than_notified(story: PackageStory) -> bool:
    """Whether its final state is not the one of which the customer was notified."""
    row, kind = story.row, f"package.{story.row.state.lower()}"
    # The one event of a rejected delivery speaks for all its packages.
    if row.state not in SETTLED_PACKAGE_STATES or row.delivery_state == "REJECTED":
        return bool(story.ends)
    end = (row.custodian_id, row.delivered_ms, row.mission_id)
    return story.ends != [(kind, *(end if row.state == "DELIVERED" else (None, None, None)))]


def _proof_differs(story: PackageStory) -> bool:
    """Whether the proof is not that of the package's row, or not that of its event."""
    row, data = story.row, story.delivered
    if row.state != "DELIVERED" or row.proof is None:
        return bool(row.state == "DELIVERED")
    proof = Proof.read(row.proof)
    is_elsewhere = proof.station_id not in (None, row.custodian_id)  # null in reports without place
    by_row = {"mission_id": proof.mission_id, "delivered_ms": moment_to_ms(proof.at)}
    if is_elsewhere or differs(row, by_row):
        return True
    evidence = data.get("evidence") or {}
    masses_kg, place = evidence.get("mass_kg"), evidence.get("place")
    notified = {
        "provider_id": data.get("provider_id"),
        "drone_id": data.get("drone_id"),
        "load_before_kg": evidence.get("load_before_kg"),
        "load_after_kg": evidence.get("load_after_kg"),
        "mass_kg": masses_kg.get(row.package_id) if isinstance(masses_kg, Mapping) else None,
        "position": place.get("position") if isinstance(place, Mapping) else None,
    }
    kept = proof.model_dump(mode="json")
    # What the drone said in an unknown form was left out of the proof.
    return any(
        kept[name] is not None and value is not None and kept[name] != value
        for name, value in notified.items()
    )


_DUE_LATER: Final = (
    select(packages, deliveries.c.request)
    .join(deliveries, deliveries.c.delivery_id == packages.c.delivery_id)
    .where(not_(IS_DUE_AS_PROMISED))
)


def _is_due_otherwise(row: Any) -> bool:  # a row of _DUE_LATER
    """Whether it is not due when promised, plus what its window or its customer allows."""
    if row.promised_ms is None:
        return True
    p90_at = None if row.promised_p90_ms is None else ms_to_moment(row.promised_p90_ms)
    request, eta_at = DeliveryRequest.read(row.request), ms_to_moment(row.promised_ms)
    due_at = due_of(row.package_id, eta_at, p90_at, request)
    # The parts of a millisecond that are not stored may add up to another one.
    return bool(abs(row.due_ms - moment_to_ms(due_at)) > 1)


_PROMISES: Final = {"promised_ms": "eta_at", "promised_p90_ms": "eta_p90_at", "due_ms": "due_at"}


def _is_promised_otherwise(story: PackageStory) -> bool:
    """Whether its promise is not that of its delivery's last event that planned or promised it."""
    if story.row.mission_id is None and story.row.promised_ms is None:
        return False
    return not all(
        _is_same_moment(getattr(story.row, name), story.planned.get(member))
        for name, member in _PROMISES.items()
    )


def _is_same_moment(moment_ms: int | None, text: str | None) -> bool:
    """Whether a stored moment is that of an event, up to the rounding to a millisecond."""
    if moment_ms is None or text is None:
        return moment_ms is None and text is None
    return abs(moment_ms - ms_of(text)) <= 1


PACKAGES: Final = (
    Rule(
        "a package has the promise that its customer was notified of",
        each_where(package_stories, _is_promised_otherwise),
        "Set `promised_ms`, `promised_p90_ms` and `due_ms` to `eta_at`, `eta_p90_at` and `due_at` "
        "of the delivery's last event `delivery.planned` or `delivery.promised`.",
    ),
    Rule(
        "I6 a package on its way has one mission, which is under way",
        select(_name).where(
            ~_is_settled,
            or_(packages.c.mission_id.is_not(None), packages.c.state != "CREATED"),
            ~exists().where(_is_its_mission, _is_live),
        ),
        "Nothing will end this package's way. See in composition how its mission ended (GET "
        "/v1/missions/{id}), and correct the package or the mission here.",
    ),
    Rule(
        "I6 a package's mission is one of its delivery's",
        select(_name).where(packages.c.mission_id.is_not(None), ~exists().where(_is_its_mission)),
        "Set `mission_id` to the mission of this delivery that carries the package: composition's "
        "`custody` names it.",
    ),
    Rule(
        "I6 a package's chain of custody has no gap",
        any_of(
            _name,
            _link_count() != packages.c.custody_seq,
            _link_count(custody.c.seq.between(1, packages.c.custody_seq)) != packages.c.custody_seq,
        ),
        _FROM_COMPOSITION,
    ),
    Rule(
        "I6 a package's custodian is the last one of its chain",
        select(_name).where(
            _link_count(
                custody.c.seq == packages.c.custody_seq,
                custody.c.custodian_kind == packages.c.custodian_kind,
                custody.c.custodian_id == packages.c.custodian_id,
            )
            != 1
        ),
        _FROM_COMPOSITION,
    ),
    Rule(
        "I6 a package is delivered once, and then with its recipient",
        any_of(
            _name,
            _link_count(custody.c.custodian_kind == "RECIPIENT") > 1,
            and_(_is_delivered, ~_is_with_recipient),
            and_(~_is_delivered, _is_with_recipient),
        ),
        _FROM_COMPOSITION,
    ),
    Rule(
        "I6 a package is where its state says",
        select(_name).where(
            ~or_(
                *(
                    and_(packages.c.custodian_kind == kind, packages.c.state.in_(states))
                    for kind, states in _MAY_HAVE.items()
                )
            )
        ),
        _FROM_COMPOSITION,
    ),
    Rule(
        "I6 a chain of custody begins at the pickup",
        each_where(
            package_stories,
            lambda story: (
                story.asked is not None and story.links[:1] != [("STATION", story.asked[0])]
            ),
        ),
        _FROM_COMPOSITION,
    ),
    Rule(
        "I6 packages pass from station to drone and from drone to station or recipient",
        each_where(package_stories, _has_impossible_link),
        _FROM_COMPOSITION,
    ),
    Rule(
        "I6 only drones of the delivery's missions have its packages",
        each_where(package_stories, lambda story: not story.had_by("DRONE") <= story.drones),
        _FROM_COMPOSITION,
    ),
    Rule(
        "I6 a package is delivered at its destination or its alternative",
        each_where(
            package_stories,
            lambda story: (
                story.asked is not None and not story.had_by("RECIPIENT") <= story.asked[1]
            ),
        ),
        _FROM_EVENTS,
    ),
    Rule(
        "I6 a package ends as its customer was notified",
        each_where(package_stories, _ends_otherwise_than_notified),
        _FROM_EVENTS,
    ),
    Rule(
        "a delivered package has the proof of its hand-over",
        each_where(package_stories, _proof_differs),
        "The event `package.delivered` has the same evidence: correct `proof`, or the columns that "
        "differ from it.",
    ),
    Rule(
        "a package has a P90 only with a promise, and not before it",
        select(_name).where(
            packages.c.promised_p90_ms.is_not(None),
            or_(
                packages.c.promised_ms.is_(None),
                packages.c.promised_p90_ms < packages.c.promised_ms,
            ),
        ),
        "Set `promised_p90_ms` to null: it is an estimate, and the delivery does not need it.",
    ),
    Rule(
        "a package is due at the moment that was promised",
        rows_where(_DUE_LATER, _is_due_otherwise, *_NAMES),
        "Set `due_ms` to `promised_p90_ms`, or `promised_ms` without it or with `promise` P50, and "
        "add `may_be_later_s`; or to the end of its window. Go no further than the deadline.",
    ),
)
