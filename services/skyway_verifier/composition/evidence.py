"""What the database says of each mission and package, for rules that compare several tables.

Of a mission: its steps beside the instructions that sent them. Of a package: its chain of custody,
and the reported hand-overs.
"""

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from skyway_composition.tables import custody, instructions, mission_steps, missions
from sqlalchemy import select

from skyway_verifier.composition.shares import owners
from skyway_verifier.rule import Survey

#: The kinds of instructions that carry steps.
_REVISIONS: Final = ("MISSION", "DIVERT", "RETURN_HOME")

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
        .where(instructions.c.kind.in_(_REVISIONS))
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


@dataclass(slots=True)
class PackageStory:
    """A package of a delivery: its chain, and the missions that were to carry it."""

    chain: list[Any] = field(default_factory=list)  # rows of custody, in order
    pickups: set[str] = field(default_factory=set)
    goals: set[str] = field(default_factory=set)
    #: Missions that were given up: a late hand-over by their drone is recorded without its step.
    given_up: set[str] = field(default_factory=set)
    #: (mission, station) of each hand-over to a recipient that a drone has reported.
    handed_over: list[tuple[str, str]] = field(default_factory=list)

    @property
    def delivered(self) -> Any | None:  # a row of custody
        """The link to its recipient."""
        return next((row for row in self.chain if row.custodian_kind == "RECIPIENT"), None)


async def package_stories(survey: Survey) -> Mapping[tuple[str, str], PackageStory]:
    """All packages by delivery and package, with what the missions and drones say of them."""
    found: dict[tuple[str, str], PackageStory] = defaultdict(PackageStory)
    chains = select(custody).order_by(custody.c.delivery_id, custody.c.package_id, custody.c.seq)
    async for row in survey.each(chains):
        found[row.delivery_id, row.package_id].chain.append(row)
    delivery_of: dict[str, str] = {}
    owner_of = await survey.once(owners)
    query = select(
        missions.c.mission_id,
        missions.c.delivery_id,
        missions.c.request,
        missions.c.aims,
        missions.c.state,
    )
    async for row in survey.each(query):
        delivery_of[row.mission_id] = row.delivery_id
        for package_id, pickup, goals in _requested(row):
            owner = owner_of.get((row.mission_id, package_id), (row.delivery_id, package_id))
            if owner is None:
                continue
            package = found[owner]
            package.pickups.add(pickup)
            package.goals |= goals
            if row.state in ("ABORTED", "CANCELLED", "REFUSED"):
                package.given_up.add(row.mission_id)
    done = mission_steps.c.status == "ENDED", mission_steps.c.kind == "DELIVER"
    async for row in survey.each(select(mission_steps).where(*done)):
        for package_id, station_id in _handed_over(row):
            alone = delivery_of.get(row.mission_id, ""), package_id
            owner = owner_of.get((row.mission_id, package_id), alone)
            if owner is not None:
                found[owner].handed_over.append((row.mission_id, station_id))
    return found


def _requested(row: Any) -> Iterator[tuple[str, str, set[str]]]:  # a row of missions
    """Each package of a mission: its id, its pickup, and where it may be delivered."""
    try:
        request, aims = json.loads(row.request), json.loads(row.aims)
        for each in request["packages"]:
            other = each.get("alternative")
            goals = {each["destination"]["station_id"]}
            goals |= {other["station_id"]} if other else set()
            goals |= {it["station_id"] for it in aims if it["package_id"] == each["package_id"]}
            yield each["package_id"], request["pickup"]["station_id"], goals
    except (ValueError, KeyError, TypeError):
        return  # another rule names texts that cannot be read


def _handed_over(row: Any) -> Iterator[tuple[str, str]]:  # a DELIVER in mission_steps
    """The packages that a drone has handed over, and where; none if the step was cut."""
    step, is_cut = step_json(row), '"code":"CUT"' in (row.event or "")
    if step is None or is_cut:
        return
    for package_id in step.get("package_ids", ()):
        yield package_id, step.get("station_id", "")
