"""The rule of custody against place and time: no drone hands over sooner than it can fly there."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

from skyway_composition.missions.following.plausibility import shortest_flight
from skyway_composition.tables import custody, missions, stations
from sqlalchemy import select

from skyway.contracts.candidate import Candidate
from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m
from skyway_verifier.rule import Rule, Survey

#: Moments are stored in whole milliseconds.
_ROUNDING_MS: Final = 1.0


@dataclass(slots=True)
class _Trip:
    """Where the drone of a mission loaded and delivered, with the moments, in their order."""

    pickup: str
    model: DroneModel
    places: list[tuple[int, str]] = field(default_factory=list)


async def _too_fast(survey: Survey) -> list[str]:
    position_of = {
        row.station_id: Position(row.longitude_deg, row.latitude_deg)
        async for row in survey.each(select(stations))
    }
    return [
        mission_id
        for mission_id, trip in (await _trips(survey)).items()
        if _is_too_fast(trip, position_of)
    ]


async def _trips(survey: Survey) -> Mapping[str, _Trip]:
    """By mission: what its drone did; a mission whose texts cannot be read is left out."""
    found: dict[str, _Trip] = {}
    columns = select(missions.c.mission_id, missions.c.candidate, missions.c.request)
    async for row in survey.each(columns):
        trip = _trip(row)
        if trip is not None:
            found[row.mission_id] = trip
    links = select(custody).where(custody.c.custodian_kind.in_(("DRONE", "RECIPIENT")))
    async for row in survey.each(links.order_by(custody.c.at_ms, custody.c.seq)):
        trip = found.get(row.mission_id)
        if trip is not None:
            is_loading = row.custodian_kind == "DRONE"
            trip.places.append((row.at_ms, trip.pickup if is_loading else row.custodian_id))
    return found


def _trip(row: Any) -> _Trip | None:  # a row of missions
    try:
        pickup = json.loads(row.request)["pickup"]["station_id"]
        return _Trip(pickup, Candidate.read(row.candidate).model)
    except (ValueError, KeyError, TypeError):
        return None  # another rule names texts that cannot be read


def _is_too_fast(trip: _Trip, position_of: Mapping[str, Position]) -> bool:
    known: Sequence[tuple[int, Position]] = [
        (at_ms, position_of[station_id])
        for at_ms, station_id in trip.places
        if station_id in position_of
    ]
    return any(
        after_ms - before_ms
        < shortest_flight(distance_m(before, after), trip.model).total_seconds() * 1000
        - _ROUNDING_MS
        for (before_ms, before), (after_ms, after) in pairwise(known)
    )


REACH: Final = (
    Rule(
        "I6 no drone hands packages over sooner than it can fly there",
        _too_fast,
        "The drone cannot have been at both stations at these moments: it was believed wrongly, or "
        "a row of `custody` was changed. Ask people where the packages are, and do not pay the "
        "mission before they have answered.",
    ),
)
