"""The rules of pads: no overlap; each mission and held offer has exactly the pads that it needs.

A hold of an offer keeps its drones and its pads until one moment.
"""

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import Any, Final

from skyway_composition.missions.booking.hold_store import HELD_OFFERS, HeldOffer, pads_of_offers
from skyway_composition.tables import (
    drone_links,
    is_live,
    is_open,
    is_queued,
    mission_steps,
    missions,
    offer_holds,
    pad_reservations,
    stations,
)
from sqlalchemy import and_, exists, func, or_, select

from skyway.contracts.flight_step import RechargeStep
from skyway.ids import MissionId
from skyway.scheduling.trip import BookedPad, merged, without
from skyway.units import moment_to_ms
from skyway_verifier.finders import each_where, readable
from skyway_verifier.rule import Rule, Survey

_one = pad_reservations.alias("one")
_other = pad_reservations.alias("other")

_REPLAN: Final = (
    "Replan the mission: HOLD and then RESUME it (POST /v1/missions/{id}/commands). A new plan "
    "reserves exactly its pads."
)

_planned_pad = and_(
    mission_steps.c.status == "PLANNED",
    mission_steps.c.kind == "RECHARGE",
    ~exists().where(
        stations.c.station_id == mission_steps.c.station_id,
        mission_steps.c.pad.between(0, stations.c.pads - 1),
    ),
)

_RELEASE: Final = (
    "Nothing is lost: delete the hold's rows of `pad_reservations`, set `held_by` and "
    "`held_until_ms` of its drones to NULL, and delete its row of `offer_holds`. An offer that is "
    "accepted then is planned again."
)


async def _pads(survey: Survey) -> Mapping[str, tuple[set[BookedPad], set[BookedPad]]]:
    """By mission: the pads that it needs, and those that it holds."""
    held = _reserved(await survey.rows(select(pad_reservations)), "mission_id")
    return {key: (pads, held[key]) for key, pads in (await _needed_pads(survey)).items()}


def _reserved(rows: Iterable[Any], key: str) -> dict[str, set[BookedPad]]:
    """The pads in rows of pad_reservations, by the mission or the hold that has them."""
    found: dict[str, set[BookedPad]] = defaultdict(set)
    for row in rows:
        booked = BookedPad(row.station_id, row.pad, row.start_ms, row.end_ms)
        found[getattr(row, key)].add(booked)
    return found


async def _needed_pads(survey: Survey) -> dict[MissionId, set[BookedPad]]:
    """The pads that each mission needs until it is over; those that need a plan are left out.

    Needed are the sessions of all planned steps and of proposed steps. A session that has ended
    still holds its pad for the gap before the next drone.
    """
    live = await survey.rows(
        select(missions.c.mission_id, missions.c.body, missions.c.proposal).where(
            is_open, missions.c.stuck.is_(None)
        )
    )
    gaps_ms = {row.mission_id: _gap_ms(json.loads(row.body)) for row in live}
    needed = {row.mission_id: _proposed_pads(row.proposal) for row in live}
    charging = await survey.rows(
        select(mission_steps.c.mission_id, mission_steps.c.step, mission_steps.c.ended_ms)
        .join(missions, missions.c.mission_id == mission_steps.c.mission_id)
        .where(
            is_open,
            missions.c.stuck.is_(None),
            mission_steps.c.status.in_(("PLANNED", "ENDED")),
            mission_steps.c.kind == "RECHARGE",
        )
    )
    for row in charging:
        session = _session(json.loads(row.step), gaps_ms[row.mission_id], ended_ms=row.ended_ms)
        needed[row.mission_id] += session
    queued = await _queued_pads(survey)
    return {
        mission_id: set(without(merged(pads), queued.get(mission_id, ())))
        for mission_id, pads in needed.items()
    }


async def _queued_pads(survey: Survey) -> Mapping[str, set[BookedPad]]:
    """By mission: the pads that later missions of its drone hold, which wait in the calendar."""
    waiting = missions.alias("waiting")
    rows = await survey.rows(
        select(missions.c.mission_id.label("before_id"), pad_reservations)
        .join(waiting, waiting.c.drone_id == missions.c.drone_id)
        .join(pad_reservations, pad_reservations.c.mission_id == waiting.c.mission_id)
        .where(
            or_(is_live, and_(is_queued, waiting.c.start_ms > missions.c.start_ms)),
            waiting.c.state == "QUEUED",
        )
    )
    return _reserved(rows, "before_id")


def _proposed_pads(text: str | None) -> list[BookedPad]:
    if text is None:
        return []
    proposal = json.loads(text)
    gap_ms = _gap_ms(proposal["mission"])
    return [pad for step in proposal["steps"] for pad in _session(step, gap_ms)]


def _session(
    step: Mapping[str, Any],  # the JSON of a FlightStep
    gap_ms: int,
    *,
    ended_ms: int | None = None,
) -> list[BookedPad]:
    """The reservation that a step needs; empty for a step that does not charge."""
    if step["kind"] != "RECHARGE":
        return []
    recharge = RechargeStep.model_validate(step)
    start_ms, end_ms = moment_to_ms(recharge.not_before_at), moment_to_ms(recharge.not_after_at)
    until_ms = gap_ms + (end_ms if ended_ms is None else min(end_ms, ended_ms))
    if start_ms >= min(end_ms, until_ms):
        return []
    return [BookedPad(recharge.station_id, recharge.pad, start_ms, until_ms)]


def _gap_ms(mission: Mapping[str, Any]) -> int:  # the JSON of a Mission
    gap_s: float = mission["margins"]["pad_gap_s"]
    return round(gap_s * 1000)


PADS: Final = (
    Rule(
        "I1 no pad holds two overlapping reservations",
        select(_one.c.station_id).join(
            _other,
            and_(
                _one.c.station_id == _other.c.station_id,
                _one.c.pad == _other.c.pad,
                _one.c.start_ms < _other.c.end_ms,
                _other.c.start_ms < _one.c.end_ms,
                or_(
                    _one.c.start_ms != _other.c.start_ms,
                    func.coalesce(_one.c.mission_id, _one.c.hold_id)
                    != func.coalesce(_other.c.mission_id, _other.c.hold_id),
                ),
            ),
        ),
        "Two drones may land on one pad. " + _REPLAN + " Make the constraint `pad_taken` again.",
    ),
    Rule(
        "I1 a reserved pad is a pad of its station",
        select(pad_reservations.c.mission_id).where(
            # The pads of a hold may go with a new network: its offer is then planned again.
            pad_reservations.c.mission_id.is_not(None),
            ~exists().where(
                stations.c.station_id == pad_reservations.c.station_id,
                pad_reservations.c.pad.between(0, stations.c.pads - 1),
            ),
        ),
        "The station has no such pad, so the drone cannot charge there. " + _REPLAN,
    ),
    Rule(
        "I1 a planned recharge uses a pad of its station",
        select(mission_steps.c.mission_id)
        .join(missions, missions.c.mission_id == mission_steps.c.mission_id)
        .where(is_open, _planned_pad),
        "The station has no such pad, so the drone cannot charge there. " + _REPLAN,
    ),
    Rule(
        "I3 a reservation has a mission that is not over",
        select(pad_reservations.c.mission_id)
        .join(missions, missions.c.mission_id == pad_reservations.c.mission_id)
        .where(~is_open),
        "Nobody uses the pad, and nobody else can. Delete the rows of `pad_reservations` of this "
        "mission once its drone has left the pad.",
    ),
    Rule(
        "I3 a mission holds the pads of its steps",
        each_where(_pads, lambda pads: not pads[0] <= pads[1]),
        _REPLAN,
    ),
    Rule(
        "I3 a mission holds no pad that it does not need",
        each_where(_pads, lambda pads: not pads[1] <= pads[0]),
        "Other drones could use the pad. " + _REPLAN,
    ),
)


async def _holds(survey: Survey) -> dict[str, tuple[int, tuple[HeldOffer, ...]]]:
    """By hold: until when it lasts, and its offers; a text that cannot be read is left out."""
    found = {}
    for row in await survey.rows(select(offer_holds)):
        offers = readable(None, HELD_OFFERS.validate_json, row.offers)
        if offers is not None:
            found[row.hold_id] = row.until_ms, offers
    return found


async def _without_drone(survey: Survey) -> list[str]:
    """Holds with a drone that no hold keeps; a later hold may have it after this one expired."""
    held = select(drone_links).where(drone_links.c.held_by.is_not(None))
    kept_ms = {row.drone_id: row.held_until_ms for row in await survey.rows(held)}
    return [
        hold_id
        for hold_id, (until_ms, offers) in (await survey.once(_holds)).items()
        if any(kept_ms.get(each, 0) < until_ms for held in offers for each in held.drone_ids)
    ]


async def _without_pads(survey: Survey) -> list[str]:
    """Holds of idle drones with other pads than those of their offers.

    A drone on a mission may share pads with this mission, so nobody knows which ones it needs.
    """
    reserved = _reserved(await survey.rows(select(pad_reservations)), "hold_id")
    return [
        hold_id
        for hold_id, (_, offers) in (await survey.once(_holds)).items()
        if all(part.opening is None for held in offers for part in held.offer.parts)
        and set(pads_of_offers(offers)) != reserved[hold_id]
    ]


HOLDS: Final = (
    Rule(
        "I17 a held drone names its hold, and is held as long",
        select(drone_links.c.drone_id).where(
            drone_links.c.held_by.is_not(None),
            ~exists().where(
                offer_holds.c.hold_id == drone_links.c.held_by,
                offer_holds.c.until_ms == drone_links.c.held_until_ms,
            ),
        ),
        _RELEASE,
    ),
    Rule(
        "I17 a held pad is held as long as its hold",
        select(pad_reservations.c.hold_id)
        .join(offer_holds, offer_holds.c.hold_id == pad_reservations.c.hold_id)
        .where(offer_holds.c.until_ms != pad_reservations.c.held_until_ms),
        _RELEASE,
    ),
    Rule("I17 a hold keeps the drones of its offers", _without_drone, _RELEASE),
    Rule("I17 a hold keeps the pads of its offers", _without_pads, _RELEASE),
)
