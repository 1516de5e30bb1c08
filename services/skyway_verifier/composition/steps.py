"""The rules of the steps of missions: they are what was sent, can be flown, and have evidence."""

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any, Final

from skyway_composition.tables import cut_steps, instructions, is_live, mission_steps, missions
from sqlalchemy import func, or_, select

from skyway.contracts.candidate import Candidate
from skyway.delivery.request import DeliveryRequest
from skyway.drone.flight import flight_energy_j
from skyway.drone.model import DroneModel
from skyway.units import ms_to_moment
from skyway_verifier.finders import differs, each_where, ms_of, readable, repeats, rows_where
from skyway_verifier.rule import Rule, Survey

#: Share of the battery by which a stretch may be short: rounding only, as in the drone's own check.
_ENERGY_TOLERANCE: Final = 1e-6

#: Steps are kept in whole milliseconds, windows in microseconds.
_ROUNDING: Final = timedelta(milliseconds=1)

#: The kinds of instructions that carry steps.
_REVISIONS: Final = ("MISSION", "DIVERT", "RETURN_HOME")

#: A step's JSON: its members have values of every type.
StepJson = Mapping[str, Any]

#: The column of each member of a step, and the members that a step of a kind has beside these two.
_COLUMNS: Final = {
    "step_id": "step_id",
    "kind": "kind",
    "station_id": "station_id",
    "pad": "pad",
    "from": "from_station_id",
    "to": "to_station_id",
    "lands": "lands",
}
_MEMBERS: Final = {"FLY": ("from", "to", "lands"), "RECHARGE": ("station_id", "pad")}

_cut_count = (
    select(func.count())
    .where(cut_steps.c.mission_id == missions.c.mission_id)
    .correlate(missions)
    .scalar_subquery()
)


@dataclass(slots=True)
class SentMission:
    """A mission's rows: its revision, its steps, and the steps that each revision has sent."""

    revision: int
    rows: list[Any] = field(default_factory=list)  # of mission_steps
    sent: dict[int, dict[int, StepJson]] = field(default_factory=dict)


async def sent_missions(survey: Survey) -> Mapping[str, SentMission]:
    """All missions by id; a mission or an instruction that cannot be read is left out."""
    found: dict[str, SentMission] = {}
    async for row in survey.each(select(missions.c.mission_id, missions.c.body)):
        revision = readable(None, lambda text: json.loads(text)["revision"], row.body)
        if isinstance(revision, int):
            found[row.mission_id] = SentMission(revision)
    steps = select(mission_steps).order_by(mission_steps.c.mission_id, mission_steps.c.step_id)
    async for row in survey.each(steps):
        if row.mission_id in found:
            found[row.mission_id].rows.append(row)
    sent = select(instructions.c.mission_id, instructions.c.mission_revision, instructions.c.body)
    of_steps = sent.where(instructions.c.kind.in_(_REVISIONS))
    async for row in survey.each(of_steps.order_by(instructions.c.stream, instructions.c.seq)):
        by_number = readable(None, _sent_steps, row.body)
        if by_number is not None and row.mission_id in found:
            found[row.mission_id].sent[row.mission_revision] = by_number
    return found


def _sent_steps(body: str) -> dict[int, StepJson]:
    return {each["step_id"]: each for each in json.loads(body)["steps"]}


def step_json(row: Any) -> StepJson | None:  # a row of mission_steps
    """The step in a row; None if it cannot be read."""
    step = readable(None, json.loads, row.step)
    return step if isinstance(step, dict) else None


def _differs_from_sent(mission: SentMission) -> bool:
    """Whether a step is not the one that was sent, or a step of any revision is missing."""
    if any(row.step_id != number for number, row in enumerate(mission.rows, start=1)):
        return True
    present = {row.step_id for row in mission.rows if row.revision == mission.revision}
    if mission.sent and present != mission.sent.get(mission.revision, {}).keys():
        return True
    return any(_is_changed(mission, row) for row in mission.rows)


def _is_changed(mission: SentMission, row: Any) -> bool:  # a row of mission_steps
    sent, step = mission.sent.get(row.revision), step_json(row)
    if sent is None or step is None:
        return False  # other rules name an instruction or a text that is missing
    # A later revision may change `lands`.
    return {**step, "lands": None} != {**sent.get(row.step_id, {}), "lands": None}


def _has_other_columns(mission: SentMission) -> bool:
    return any(readable(False, _columns_differ, row) for row in mission.rows)


def _columns_differ(row: Any) -> bool:  # a row of mission_steps
    step = json.loads(row.step)
    members = ("step_id", "kind", *_MEMBERS.get(step["kind"], ("station_id",)))
    said = dict.fromkeys(_COLUMNS.values())
    said |= {_COLUMNS[name]: step.get(name) for name in members}
    said |= {f"planned_{end}_ms": ms_of(step[f"planned_{end}_at"]) for end in ("start", "end")}
    return differs(row, said)


def _lacks_evidence(mission: SentMission) -> bool:
    return any(
        row.event is None or row.ended_ms is None or readable(False, _evidence_differs, row)
        for row in mission.rows
        if row.status != "PLANNED"
    )


def _evidence_differs(row: Any) -> bool:  # a row of mission_steps that has ended
    event = json.loads(row.event)
    moments = {"ended_ms": ms_of(event["ended_at"]), "started_ms": _ms(event["started_at"])}
    return not repeats(row, event, "mission_id", "step_id") or differs(row, moments)


def _ms(text: str | None) -> int | None:
    return None if text is None else ms_of(text)


async def _short_of_energy(survey: Survey) -> list[str]:
    query = select(missions.c.mission_id, missions.c.candidate).where(is_live)
    sent = await survey.once(sent_missions)
    return [
        row.mission_id
        for row in await survey.rows(query)
        if row.mission_id in sent
        and readable(False, _needs_too_much, sent[row.mission_id], row.candidate)
    ]


def _needs_too_much(mission: SentMission, candidate: str) -> bool:
    """Whether a planned stretch between two recharges needs more energy than the battery has then.

    Of a mission that has begun, or has a new plan, we do not know with how much charge its first
    stretch begins: it is compared with a full battery.
    """
    drone = Candidate.read(candidate)
    model, rows = drone.planned_model, mission.rows
    is_new = mission.revision == 1 and all(row.status == "PLANNED" for row in rows)
    soc = drone.soc if is_new else model.top_soc
    least_soc = model.reserve_soc - _ENERGY_TOLERANCE
    return any(
        need_j > (begin_soc - least_soc) * model.battery_j
        for begin_soc, need_j in _stretches(rows, model, soc=soc)
    )


def _stretches(
    rows: Iterable[Any],  # rows of mission_steps, in order
    model: DroneModel,
    *,
    soc: float,
) -> Iterator[tuple[float, float]]:
    """Each planned stretch up to a recharge: its state of charge at first, and what it needs."""
    load_kg: dict[str, float] = {}
    need_j = 0.0
    for row in rows:
        step = step_json(row) or {"kind": None}
        match step["kind"]:
            case "PICK_UP":
                load_kg |= {each["package_id"]: each["mass_kg"] for each in step["packages"]}
            case "DELIVER" | "RETURN":
                load_kg = {key: kg for key, kg in load_kg.items() if key not in step["package_ids"]}
            case "FLY" if row.status == "PLANNED":
                flown_kg = sum(load_kg.values())
                in_air = step.get("time_factor", 1.0) * step.get("energy_factor", 1.0)
                flight_j = flight_energy_j(model, length_m=step["length_m"], load_kg=flown_kg)
                need_j += in_air * flight_j
                need_j += model.stop_j if step["lands"] else 0.0
            case "RECHARGE" if row.status == "PLANNED":
                yield soc, need_j
                soc, need_j = max(soc - need_j / model.battery_j, step["until_soc"]), 0.0
    yield soc, need_j


def _cut_differs(row: Any) -> bool:  # a row of cut_steps
    event = json.loads(row.event)
    moments = {"started_ms": _ms(event["started_at"]), "ended_ms": _ms(event["ended_at"])}
    is_same = repeats(row, event, "mission_id", "seq", "step_id", "station_id")
    return not is_same or differs(row, {"kind": event["step_kind"], **moments})


async def _outside_their_windows(survey: Survey) -> list[str]:
    """Missions whose first plan loads, or hands over a package, when the request forbids it.

    Later revisions are left out: a plan that changes in flight may be late.
    """
    steps: dict[str, list[Any]] = defaultdict(list)
    is_hand_over = mission_steps.c.kind.in_(("PICK_UP", "DELIVER"))
    first = select(mission_steps).where(mission_steps.c.revision == 1, is_hand_over)
    async for step in survey.each(first):
        steps[step.mission_id].append(step)
    return [
        row.mission_id
        async for row in survey.each(select(missions.c.mission_id, missions.c.request))
        if readable(False, _is_outside, row.request, steps[row.mission_id])
    ]


def _is_outside(text: str, steps: Iterable[Any]) -> bool:  # rows of mission_steps
    request = DeliveryRequest.read(text)
    packages = {each.package_id: each for each in request.packages}
    for step in steps:
        if step.kind == "PICK_UP":
            windows = [(request.earliest_pickup_at, request.latest_pickup_at)]
        else:
            carried = (step_json(step) or {}).get("package_ids", ())
            known = [packages[package_id] for package_id in carried if package_id in packages]
            windows = [(each.not_before_at, each.latest_at) for each in known]
            windows += [(None, request.qos.deadline_at)] if known else []
        if not all(_is_within(step, *window) for window in windows):
            return True
    return False


def _is_within(step: Any, earliest_at: datetime | None, latest_at: datetime | None) -> bool:
    start_at = ms_to_moment(step.planned_start_ms) + _ROUNDING
    end_at = ms_to_moment(step.planned_end_ms) - _ROUNDING
    return (earliest_at is None or earliest_at <= start_at) and (
        latest_at is None or end_at <= latest_at
    )


STEPS: Final = (
    Rule(
        "I4 a mission's steps are those that were sent",
        each_where(sent_missions, _differs_from_sent),
        "The drone flies what `instructions.body` of this revision says, and composition expects "
        "something else. Restore `mission_steps.step` from that instruction.",
    ),
    Rule(
        "a step's columns say what the step says",
        each_where(sent_missions, _has_other_columns),
        "Closures and statistics read the columns. Set them to the values of `mission_steps.step`.",
    ),
    Rule(
        "a step that has ended has the drone's event as evidence",
        each_where(sent_missions, _lacks_evidence),
        "The step was ended by hand, or its event was changed. The drone's journal has the event: "
        "compare it, and restore the row from a backup.",
    ),
    Rule(
        "a step that is planned has no event",
        select(mission_steps.c.mission_id).where(
            mission_steps.c.status == "PLANNED",
            or_(mission_steps.c.event.is_not(None), mission_steps.c.ended_ms.is_not(None)),
        ),
        "The step has ended: set its `status` to ENDED, or to FAILED if its event is STEP_FAILED.",
    ),
    Rule(
        "I10 a live mission's steps need no more energy than the battery has",
        _short_of_energy,
        "The drone refuses such steps before its take-off, but do not rely on it: hold the mission "
        "(POST /v1/missions/{id}/commands with HOLD), restore the steps from `instructions.body`, "
        "and resume it.",
    ),
    Rule(
        "a cut step says what its event says",
        rows_where(select(cut_steps), _cut_differs, "mission_id"),
        "Statistics read the columns. Set them to the values of `cut_steps.event`.",
    ),
    Rule(
        "a mission counts its cut steps",
        select(missions.c.mission_id).where(missions.c.cuts != _cut_count),
        "A row of `cut_steps` was deleted or invented. The drone's journal has the event: restore "
        "the row from a backup, or set `missions.cuts` to the number of its rows.",
    ),
    Rule(
        "a mission's first plan keeps the windows and the deadline of its request",
        _outside_their_windows,
        "The request or the steps were changed. Compare `missions.request` with the request at the "
        "gateway, and the steps with `instructions.body`; inform the customer if the plan is late.",
    ),
)
