"""The steps of missions beside the instructions that sent them."""

import json
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from sqlalchemy import select

from skyway.runtime.verification.survey import Survey
from skyway_composition.tables import instructions, mission_steps, missions

#: The kinds of instructions that carry steps.
REVISIONS: Final = ("MISSION", "DIVERT", "RETURN_HOME")

#: A step's JSON: its members have values of every type.
StepJson = Mapping[str, Any]


@dataclass(slots=True)
class SentMission:
    """A mission's rows: its revision, its steps, and the steps that each revision has sent."""

    mission_id: str
    revision: int
    is_live: bool
    rows: list[Any] = field(default_factory=list)  # of mission_steps
    sent: dict[int, dict[int, StepJson]] = field(default_factory=dict)


async def sent_missions(survey: Survey) -> Mapping[str, SentMission]:
    """All missions by id; a mission or an instruction that cannot be read is left out."""
    found: dict[str, SentMission] = {}
    async for row in survey.each(select(missions.c.mission_id, missions.c.state, missions.c.body)):
        revision = _member(row.body, "revision")
        if isinstance(revision, int):
            is_live = row.state in ("BOOKED", "ACCEPTED", "ACTIVE")
            found[row.mission_id] = SentMission(row.mission_id, revision, is_live)
    steps = select(mission_steps).order_by(mission_steps.c.mission_id, mission_steps.c.step_id)
    async for row in survey.each(steps):
        if row.mission_id in found:
            found[row.mission_id].rows.append(row)
    for mission_id, sent in (await _sent(survey)).items():
        if mission_id in found:
            found[mission_id].sent = sent
    return found


async def _sent(survey: Survey) -> Mapping[str, dict[int, dict[int, StepJson]]]:
    """By mission, revision and number: the steps as they were last sent."""
    query = (
        select(instructions.c.mission_id, instructions.c.mission_revision, instructions.c.body)
        .where(instructions.c.kind.in_(REVISIONS))
        .order_by(instructions.c.stream, instructions.c.seq)
    )
    sent: dict[str, dict[int, dict[int, StepJson]]] = defaultdict(dict)
    async for row in survey.each(query):
        steps = _member(row.body, "steps")
        if isinstance(steps, list):
            sent[row.mission_id][row.mission_revision] = {each["step_id"]: each for each in steps}
    return sent


def step_json(row: Any) -> StepJson | None:  # a row of mission_steps
    """The step in a row; None if it cannot be read."""
    try:
        step = json.loads(row.step)
    except ValueError:
        return None
    return step if isinstance(step, dict) else None


def _member(text: str, name: str) -> object:
    try:
        value = json.loads(text)
    except ValueError:
        return None
    return value.get(name) if isinstance(value, dict) else None
