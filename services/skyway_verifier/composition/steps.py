"""The rules of the steps of missions: they are what was sent, can be flown, and have evidence."""

import json
from collections.abc import Iterable, Iterator
from datetime import datetime
from typing import Any, Final

from skyway_composition.tables import cut_steps, is_live, mission_steps, missions
from sqlalchemy import func, or_, select

from skyway.contracts.candidate import Candidate
from skyway.drone.flight import flight_energy_j
from skyway.drone.model import DroneModel
from skyway.units import moment_to_ms
from skyway_verifier.composition.evidence import SentMission, StepJson, sent_missions, step_json
from skyway_verifier.finders import each_where, rows_where
from skyway_verifier.rule import Rule, Survey

#: Share of the battery by which a stretch may be short: rounding only, as in the drone's own check.
_ENERGY_TOLERANCE: Final = 1e-6

_cut_count = (
    select(func.count())
    .where(cut_steps.c.mission_id == missions.c.mission_id)
    .correlate(missions)
    .scalar_subquery()
)


def _differs_from_sent(mission: SentMission) -> bool:
    """Whether a step is not the one that was sent, or a step of any revision is missing."""
    if any(row.step_id != number for number, row in enumerate(mission.rows, start=1)):
        return True
    present = {row.step_id for row in mission.rows if row.revision == mission.revision}
    if mission.sent and present != mission.sent.get(mission.revision, {}).keys():
        return True
    return any(_is_changed(mission, row) for row in mission.rows)


def _is_changed(mission: SentMission, row: Any) -> bool:  # a row of mission_steps
    sent = mission.sent.get(row.revision)
    step = step_json(row)
    if sent is None or step is None:
        return False  # other rules name an instruction or a text that is missing
    return _comparable(step) != _comparable(sent.get(row.step_id, {}))


def _comparable(step: StepJson) -> StepJson:
    """The step without `lands`, which a later revision may change."""
    return {name: value for name, value in step.items() if name != "lands"}


def _has_other_columns(mission: SentMission) -> bool:
    return any(_columns_differ(row) for row in mission.rows)


def _columns_differ(row: Any) -> bool:  # a row of mission_steps
    step = step_json(row)
    if step is None:
        return False
    kind = step.get("kind")
    is_flight = kind == "FLY"
    stated = (
        step.get("step_id"),
        kind,
        None if is_flight else step.get("station_id"),
        step.get("pad") if kind == "RECHARGE" else None,
        step.get("from") if is_flight else None,
        step.get("to") if is_flight else None,
        step.get("lands") if is_flight else None,
        _ms(step.get("planned_start_at")),
        _ms(step.get("planned_end_at")),
    )
    return stated != (
        row.step_id,
        row.kind,
        row.station_id,
        row.pad,
        row.from_station_id,
        row.to_station_id,
        row.lands,
        row.planned_start_ms,
        row.planned_end_ms,
    )


def _lacks_evidence(mission: SentMission) -> bool:
    return any(_evidence_differs(row) for row in mission.rows if row.status != "PLANNED")


def _evidence_differs(row: Any) -> bool:  # a row of mission_steps that has ended
    if row.event is None or row.ended_ms is None:
        return True
    try:
        event = json.loads(row.event)
        return (event["mission_id"], event["step_id"]) != (row.mission_id, row.step_id) or (
            _ms(event["ended_at"]),
            _ms(event["started_at"]),
        ) != (row.ended_ms, row.started_ms)
    except (ValueError, KeyError, TypeError):
        return False  # another rule names texts that cannot be read


def _ms(text: Any) -> int | None:  # a member of a JSON object
    return moment_to_ms(datetime.fromisoformat(text)) if isinstance(text, str) else None


async def _short_of_energy(survey: Survey) -> list[str]:
    query = select(missions.c.mission_id, missions.c.candidate).where(is_live)
    sent = await survey.once(sent_missions)
    return [
        row.mission_id
        for row in await survey.rows(query)
        if row.mission_id in sent and _needs_too_much(sent[row.mission_id], row.candidate)
    ]


def _needs_too_much(mission: SentMission, candidate: str) -> bool:
    """Whether a planned stretch between two recharges needs more energy than the battery has then.

    Of a mission that has begun, or has a new plan, we do not know with how much charge its first
    stretch begins: it is compared with a full battery.
    """
    try:
        drone = Candidate.read(candidate)
    except ValueError:
        return False  # another rule names texts that cannot be read
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
    return (
        event["mission_id"],
        event["seq"],
        event["step_id"],
        event["step_kind"],
        event["station_id"],
        _ms(event["started_at"]),
        _ms(event["ended_at"]),
    ) != (
        row.mission_id,
        row.seq,
        row.step_id,
        row.kind,
        row.station_id,
        row.started_ms,
        row.ended_ms,
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
)
