"""Check I1 to I4, I6, I7 and I12 in composition's database (docs/reference/invariants.md)."""

import json
from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import and_, func, literal_column, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.flight_step import RechargeStep
from skyway.contracts.mission import Cancellation
from skyway.ids import MissionId
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.violations import Rules, Violation, check_of, violations_found
from skyway.units import moment_to_ms
from skyway_composition.pads.booked_pad import BookedPad, merged
from skyway_composition.tables import (
    cancellations,
    custody,
    deliveries,
    first_planned_end_ms,
    instructions,
    is_live,
    is_under_way,
    mission_steps,
    missions,
    network_versions,
    networks,
    pad_reservations,
)

_RELEASED_AND_DELIVERED: Final = "I6 a package that a cancellation released is not delivered"

_one = pad_reservations.alias("one")
_other = pad_reservations.alias("other")
_sent = instructions.alias("sent")
_before = instructions.alias("before")
_link = custody.alias("link")
_previous = custody.alias("previous")

#: Queries that must find no row, by the rule that a found row (subject,) breaks.
_RULES: Final[Rules] = {
    "I1 no pad holds two overlapping reservations": select(_one.c.station_id).join(
        _other,
        and_(
            _one.c.station_id == _other.c.station_id,
            _one.c.pad == _other.c.pad,
            _one.c.start_ms < _other.c.end_ms,
            _other.c.start_ms < _one.c.end_ms,
            (_one.c.start_ms != _other.c.start_ms) | (_one.c.mission_id != _other.c.mission_id),
        ),
    ),
    "I2 a drone is on at most one mission": select(missions.c.drone_id)
    .where(is_live)
    .group_by(missions.c.drone_id)
    .having(func.count() > 1),
    "I3 a reservation has a live mission": select(pad_reservations.c.mission_id)
    .join(missions, missions.c.mission_id == pad_reservations.c.mission_id)
    .where(~is_live),
    "I4 a mission was sent to its drone": select(missions.c.mission_id).where(
        missions.c.mission_id.not_in(
            select(instructions.c.mission_id).where(instructions.c.kind == "MISSION")
        )
    ),
    "I4 a mission has steps": select(missions.c.mission_id).where(
        missions.c.mission_id.not_in(select(mission_steps.c.mission_id))
    ),
    "a mission is checked when its next step should have ended": select(
        missions.c.mission_id
    ).where(is_under_way, missions.c.next_end_ms.is_distinct_from(first_planned_end_ms)),
    "a closed delivery has no live mission": select(missions.c.mission_id)
    .join(deliveries, deliveries.c.delivery_id == missions.c.delivery_id)
    .where(deliveries.c.closed_ms.is_not(None), is_live),
    "I7 instructions of a stream have no gaps": select(_sent.c.instruction_id).where(
        _sent.c.seq > 1,
        ~select(literal_column("1"))
        .where(
            _before.c.drone_id == _sent.c.drone_id,
            _before.c.stream == _sent.c.stream,
            _before.c.seq == _sent.c.seq - 1,
        )
        .exists(),
    ),
    "I6 a chain of custody has no gaps": select(_link.c.package_id).where(
        _link.c.seq > 1,
        ~select(literal_column("1"))
        .where(
            _previous.c.delivery_id == _link.c.delivery_id,
            _previous.c.package_id == _link.c.package_id,
            _previous.c.seq == _link.c.seq - 1,
        )
        .exists(),
    ),
    "I6 a package is delivered once": select(custody.c.package_id)
    .where(custody.c.custodian_kind == "RECIPIENT")
    .group_by(custody.c.delivery_id, custody.c.package_id)
    .having(func.count() > 1),
    "I6 nothing follows the recipient": select(_link.c.package_id).join(
        _previous,
        and_(
            _previous.c.delivery_id == _link.c.delivery_id,
            _previous.c.package_id == _link.c.package_id,
            _previous.c.seq < _link.c.seq,
            _previous.c.custodian_kind == "RECIPIENT",
        ),
    ),
    "I12 a current version is kept": select(networks.c.network_id).where(
        ~select(literal_column("1"))
        .where(
            network_versions.c.network_id == networks.c.network_id,
            network_versions.c.version == networks.c.version,
            network_versions.c.sha256 == networks.c.sha256,
        )
        .exists()
    ),
}

_CHECK: Final = check_of(_RULES)

_UNRESERVED: Final = "I3 a live mission holds the pads of its steps"

_HOARDED: Final = "I3 a live mission holds no pad that it does not need"


async def violations(db: Database) -> list[Violation]:
    """Every violation: the rule that is broken, and the row that breaks it."""
    async with db.survey() as connection:
        found = await violations_found(connection, _CHECK)
        found += await pad_violations(connection)
        released = await _released_and_delivered(connection)
    found.extend({"rule": _RELEASED_AND_DELIVERED, "subject": each} for each in released)
    return found


async def _released_and_delivered(connection: AsyncConnection) -> set[str]:
    """Packages that a cancellation released, and that were delivered nevertheless."""
    delivered = await connection.execute(
        select(custody.c.package_id, cancellations.c.answer)
        .join(cancellations, cancellations.c.delivery_id == custody.c.delivery_id)
        .where(custody.c.custodian_kind == "RECIPIENT")
    )
    return {
        row.package_id
        for row in delivered
        if row.package_id in Cancellation.read(row.answer).released
    }


async def pad_violations(connection: AsyncConnection) -> list[Violation]:
    """The live missions that hold more or fewer pads than they need."""
    found: list[Violation] = []
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
    """The pads that each live mission needs; missions that wait for a new plan are left out.

    Needed are the sessions of all planned steps and of proposed steps. A session that has ended
    still holds its pad for the gap before the next drone.
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
    """The reservation that a step needs; empty for a step that does not charge."""
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
