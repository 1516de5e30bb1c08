"""I3: a live mission holds the pads that it needs, and no others."""

import json
from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.flight_step import RechargeStep
from skyway.ids import MissionId
from skyway.units import moment_to_ms
from skyway_composition.pads.booked_pad import BookedPad, merged
from skyway_composition.tables import is_live, mission_steps, missions, pad_reservations

_UNRESERVED: Final = "I3 a live mission holds the pads of its steps"
_HOARDED: Final = "I3 a live mission holds no pad that it does not need"


async def pad_violations(connection: AsyncConnection) -> list[Mapping[str, str]]:
    """The live missions that hold other pads than they need."""
    found: list[Mapping[str, str]] = []
    needed = await _needed_pads(connection)
    held = await _held_pads(connection)
    for mission_id, pads in needed.items():
        has = held.get(mission_id, set())
        if not pads <= has:
            found.append({"rule": _UNRESERVED, "subject": str(mission_id)})
        if not has <= pads:
            found.append({"rule": _HOARDED, "subject": str(mission_id)})
    return found


async def _needed_pads(connection: AsyncConnection) -> dict[MissionId, set[BookedPad]]:
    """What each live mission needs, but for those whose drones wait for another plan.

    That is the sessions of all steps ahead, and of those that are proposed instead of them; those
    that are over until the next drone may come.
    """
    live = await connection.execute(
        select(missions.c.mission_id, missions.c.body, missions.c.proposal).where(
            is_live, missions.c.stuck.is_(None)
        )
    )
    needed: dict[MissionId, list[BookedPad]] = {}
    gaps_ms: dict[MissionId, int] = {}
    for row in live:
        gaps_ms[row.mission_id] = _gap_ms(json.loads(row.body))
        needed[row.mission_id] = _proposed_pads(row.proposal)
    charging = await connection.execute(
        select(mission_steps.c.mission_id, mission_steps.c.step, mission_steps.c.ended_ms)
        .join(missions, missions.c.mission_id == mission_steps.c.mission_id)
        .where(
            is_live,
            missions.c.stuck.is_(None),
            mission_steps.c.status.in_(("PLANNED", "ENDED")),
            mission_steps.c.kind == "RECHARGE",
        )
    )
    for row in charging:
        gap_ms = gaps_ms[row.mission_id]
        needed[row.mission_id] += _session(json.loads(row.step), gap_ms, ended_ms=row.ended_ms)
    return {mission_id: set(merged(pads)) for mission_id, pads in needed.items()}


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
    """The pad of a step as it is held, if it charges at all."""
    if step["kind"] != "RECHARGE":
        return []
    recharge = RechargeStep.model_validate(step)
    start_ms, end_ms = moment_to_ms(recharge.not_before_at), moment_to_ms(recharge.not_after_at)
    if start_ms >= end_ms:
        return []
    end_ms = gap_ms + (end_ms if ended_ms is None else min(end_ms, ended_ms))
    if start_ms >= end_ms:
        return []
    return [BookedPad(recharge.station_id, recharge.pad, start_ms, end_ms)]


def _gap_ms(mission: Mapping[str, Any]) -> int:  # the JSON of a Mission
    gap_s: float = mission["margins"]["pad_gap_s"]
    return round(gap_s * 1000)


async def _held_pads(connection: AsyncConnection) -> dict[MissionId, set[BookedPad]]:
    held: dict[MissionId, set[BookedPad]] = {}
    for row in await connection.execute(select(pad_reservations)):
        booked = BookedPad(row.station_id, row.pad, row.start_ms, row.end_ms)
        held.setdefault(row.mission_id, set()).add(booked)
    return held
