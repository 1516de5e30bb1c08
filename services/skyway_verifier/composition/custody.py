"""The rules of custody: each package has one custodian, one chain, and one delivery."""

import json
from collections import Counter
from itertools import pairwise
from typing import Any, Final

from skyway_composition.tables import (
    cancellations,
    custody,
    drone_links,
    guests,
    is_open,
    missions,
)
from sqlalchemy import and_, exists, func, or_, select

from skyway.contracts.mission import Cancellation
from skyway_verifier.composition.evidence import PackageStory, package_stories
from skyway_verifier.composition.shares import owners
from skyway_verifier.finders import each_where, rows_where
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

_ASK_PEOPLE: Final = (
    "Ask people where the package is: at its station, with its drone or with its recipient. Then "
    "correct the last row of `custody`, and notify the customer."
)
_TWO_DRONES: Final = (
    "Two drones have taken the same package, or drones carry packages that were mixed up. Hold "
    "both missions (POST /v1/missions/{id}/commands with HOLD), ask the provider what each drone "
    "carries, and bring the wrong package back."
)


def _begins_elsewhere(story: PackageStory) -> bool:
    if not story.chain or not story.pickups:
        return bool(story.pickups)
    first = story.chain[0]
    return first.custodian_kind != "STATION" or first.custodian_id not in story.pickups


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


def _is_delivered_elsewhere(story: PackageStory) -> bool:
    delivered = story.delivered
    return delivered is not None and delivered.custodian_id not in story.goals


def _is_delivered_without_evidence(story: PackageStory) -> bool:
    delivered = story.delivered
    return (
        delivered is not None
        and delivered.mission_id not in story.given_up
        and (delivered.mission_id, delivered.custodian_id) not in story.handed_over
    )


def _is_handed_over_elsewhere(story: PackageStory) -> bool:
    """Whether a drone has handed it over of whose mission the chain knows no delivery."""
    delivered = story.delivered
    by = None if delivered is None else delivered.mission_id
    return any(mission_id != by for mission_id, _ in story.handed_over)


_DELIVERED: Final = (
    select(custody, cancellations.c.answer)
    .join(cancellations, cancellations.c.delivery_id == custody.c.delivery_id)
    .where(custody.c.custodian_kind == "RECIPIENT")
)


def _is_released(row: Any) -> bool:  # a row of _DELIVERED
    return row.package_id in Cancellation.read(row.answer).released


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
        each_where(package_stories, _is_delivered_elsewhere),
        _ASK_PEOPLE,
    ),
    Rule(
        "I6 a delivery in a chain of custody has a drone's event as evidence",
        each_where(package_stories, _is_delivered_without_evidence),
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
        rows_where(_DELIVERED, _is_released, "delivery_id", "package_id"),
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
)
