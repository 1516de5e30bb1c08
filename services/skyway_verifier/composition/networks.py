"""The rules of networks and of their closures.

A version never changes, and the stations are those of the current version. No live plan uses what
was closed before the plan was made (I11).

A mission that a closure hits has a trouble, waits stuck, or has a proposal until it has another
plan. A drone that took off before it knew of the closure flies to the end of its segment. A
mission that was given up lands where it can, closed or not. Ground stops are left out: they forbid
the next take-off only, and composition enforces them every second.
"""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import timedelta
from typing import Any, Final

from skyway_composition.closures.closure import Closure
from skyway_composition.closures.conditions import Conditions
from skyway_composition.closures.read_forecast import forecast_of
from skyway_composition.closures.store import in_force
from skyway_composition.tables import (
    closures,
    drone_links,
    forecasts,
    is_live,
    mission_steps,
    missions,
    network_versions,
    networks,
    pad_reservations,
    stations,
)
from sqlalchemy import and_, exists, func, or_, select

from skyway.contracts.weather import ForecastDocument, MeasuredWind
from skyway.network.geojson_text import read_network_text
from skyway.units import NEVER_MS, moment_to_ms, ms_to_moment
from skyway_verifier.finders import readable, rows_where
from skyway_verifier.rule import Rule, Survey

_is_current = and_(
    network_versions.c.network_id == networks.c.network_id,
    network_versions.c.version == networks.c.version,
)

_CURRENT: Final = select(networks.c.network_id, network_versions.c.content).join(
    network_versions, _is_current
)

#: The values of a row of `stations`.
_Station = tuple[str | None, int, float, float]

_has_its_plan = and_(
    is_live, missions.c.trouble.is_(None), missions.c.stuck.is_(None), missions.c.proposal.is_(None)
)
#: Closures of a network's past that changed its conditions, and those that did so twice.
_concerns = and_(
    or_(closures.c.network_id == networks.c.network_id, closures.c.network_id.is_(None)),
    closures.c.made_ms > networks.c.published_ms,
)


def _is_changed(row: Any) -> bool:  # a row with a content and its hash
    return bool(hashlib.sha256(row.content).hexdigest() != row.sha256)


async def _other_stations(survey: Survey) -> list[str]:
    stored: dict[str, dict[str, _Station]] = {}
    async for row in survey.each(select(stations)):
        values = (row.name, row.pads, row.longitude_deg, row.latitude_deg)
        stored.setdefault(row.network_id, {})[row.station_id] = values
    found: list[str] = []
    for row in await survey.rows(_CURRENT):
        published, own = _published(row.content), stored.pop(row.network_id, {})
        found += sorted(
            station_id
            for station_id in published.keys() | own.keys()
            if published.get(station_id) != own.get(station_id)
        )
    return found + [station_id for own in stored.values() for station_id in own]


def _published(content: bytes) -> Mapping[str, _Station]:
    network = read_network_text(content)
    return {
        each.station_id: (each.name, each.pads, *each.position)
        for each in network.stations.values()
    }


async def _unusable_forecasts(survey: Survey) -> list[str]:
    """The networks whose forecast was changed, or cannot be read."""
    latest_ms = NEVER_MS if survey.fleet_ms is None else survey.fleet_ms
    rows = survey.each(select(forecasts))
    return [row.network_id async for row in rows if readable(True, _is_unusable, row, latest_ms)]


def _is_unusable(row: Any, latest_ms: int) -> bool:  # a row of forecasts
    document = ForecastDocument.read(row.content)
    forecast_of(document)
    moments = [document.issued_at - timedelta(hours=1), ms_to_moment(row.received_ms)]
    if row.measured is not None:
        moments.append(MeasuredWind.read(row.measured).at)
    if max(map(moment_to_ms, moments)) > latest_ms or moments[0] > moments[1]:
        return True
    return _is_changed(row)


NETWORKS: Final = (
    Rule(
        "a forecast can be read, is not from the future, and its content has its hash",
        _unusable_forecasts,
        "The row was changed by hand. Send the forecast again (PUT /v1/networks/{id}/weather), or "
        "remove it (DELETE): plans then use the wind that drones measure.",
    ),
    Rule(
        "I12 a current version is kept",
        select(networks.c.network_id).where(
            ~exists().where(
                _is_current,
                network_versions.c.sha256 == networks.c.sha256,
                network_versions.c.published_ms == networks.c.published_ms,
            )
        ),
        "Restore the row of `network_versions` from a backup, or publish the network again: PUT "
        "/v1/networks/{id}.",
    ),
    Rule(
        "I12 a network has all its versions from the oldest kept one up to the current one",
        select(networks.c.network_id)
        .join(network_versions, network_versions.c.network_id == networks.c.network_id)
        .group_by(networks.c.network_id, networks.c.version, networks.c.oldest_version)
        .having(
            or_(
                func.count() != networks.c.version - networks.c.oldest_version + 1,
                func.min(network_versions.c.version) != networks.c.oldest_version,
                func.max(network_versions.c.version) != networks.c.version,
            )
        ),
        "Restore the missing rows of `network_versions` from a backup, or set `oldest_version` to "
        "the first version after the missing ones.",
    ),
    Rule(
        "I12 a version's content has its hash",
        rows_where(select(network_versions), _is_changed, "network_id", "version"),
        "The content was changed without a new version. Restore it from a backup; if it is the "
        "current one, you may also publish the right content: PUT /v1/networks/{id}.",
    ),
    Rule(
        "I12 the stations are those of the current version",
        _other_stations,
        "Publish a new version of the network (PUT /v1/networks/{id}): it writes all stations.",
    ),
)


async def _met_by_plans(survey: Survey) -> set[str]:
    """The missions whose plans land, fly or charge where it is closed."""
    found: set[str] = set()
    for row in await survey.rows(_CURRENT):
        closed = await in_force(survey.connection, row.network_id, after_ms=0)
        if any(each.kind != "GROUND_STOP" for each in closed):
            conditions = Conditions(read_network_text(row.content), closed)
            found |= await _met_by(survey, row.network_id, conditions)
    return found


async def _met_by(survey: Survey, network_id: str, conditions: Conditions) -> set[str]:
    of_network = and_(_has_its_plan, missions.c.network_id == network_id)
    flights = await survey.rows(
        select(mission_steps, missions.c.body, drone_links.c.state)
        .join(missions, missions.c.mission_id == mission_steps.c.mission_id)
        .outerjoin(drone_links, drone_links.c.drone_id == missions.c.drone_id)
        .where(of_network, mission_steps.c.status == "PLANNED", mission_steps.c.kind == "FLY")
    )
    held = await survey.rows(
        select(pad_reservations)
        .join(missions, missions.c.mission_id == pad_reservations.c.mission_id)
        .where(of_network)
    )
    found: set[str] = set()
    for closure in conditions.closures:
        if closure.kind == "PAD":
            pad = closure.station_id, closure.pad
            on_pad = (row for row in held if (row.station_id, row.pad) == pad)
            found |= {row.mission_id for row in on_pad if _begins_within(row.start_ms, closure)}
        elif closure.kind != "GROUND_STOP":
            stations, segments = map(set, conditions.reach(closure))
            for row in flights:
                lands = row.lands and row.to_station_id in stations
                is_met = lands and _begins_within(row.planned_end_ms, closure)
                is_met = is_met or _flies(row, closure, segments)
                if is_met and json.loads(row.body)["given_up"] is None:
                    found.add(row.mission_id)
    return found


def _flies(row: Any, closure: Closure, segments: Iterable[Any]) -> bool:  # of mission_steps
    is_there = (row.from_station_id, row.to_station_id) in segments and not _has_begun(row)
    begins_before = row.planned_start_ms <= closure.from_ms < row.planned_end_ms
    is_planned_later = row.planned_start_ms > closure.made_ms
    return is_there and (
        _begins_within(row.planned_start_ms, closure) or (begins_before and is_planned_later)
    )


def _has_begun(row: Any) -> bool:  # of mission_steps, with the drone's last state
    """Whether the drone has taken off: it may have missed the plan that avoids the closure."""
    state = json.loads(row.state or "{}")
    if state.get("mission_id") != row.mission_id:
        return False
    # A standing drone reports the next step, which it may not begin before it is released.
    step_id, released_through = state.get("step_id") or 0, state.get("released_through") or 0
    return bool(step_id > row.step_id or released_through >= row.step_id == step_id)


def _begins_within(moment_ms: int, closure: Closure) -> bool:
    """Whether a moment that was ahead when the closure was made lies in the closure."""
    until_ms = math.inf if closure.until_ms is None else closure.until_ms
    return max(closure.from_ms, closure.made_ms) < moment_ms < until_ms


CLOSURES: Final[Sequence[Rule]] = (
    Rule(
        "I11 no live plan uses what is closed",
        _met_by_plans,
        "The closure was made without the service, so no mission was replanned. Lift it and make "
        "it again (DELETE and POST of the closure): missions that it hits get other plans.",
    ),
    Rule(
        "a closure is lifted after it was made",
        select(closures.c.closure_id).where(closures.c.lifted_ms < closures.c.made_ms),
        "Its times were changed. The audit log has the calls that made and lifted it: correct "
        "`made_ms` or `lifted_ms`.",
    ),
    Rule(
        "I11 a network's conditions count every closure",
        select(networks.c.network_id).where(
            networks.c.conditions
            < select(func.count(closures.c.made_ms) + func.count(closures.c.lifted_ms))
            .where(_concerns)
            .correlate(networks)
            .scalar_subquery()
        ),
        "A closure was made or lifted without the service, so cached conditions are out of date. "
        "Lift it and make it again (DELETE and POST of the closure).",
    ),
)
