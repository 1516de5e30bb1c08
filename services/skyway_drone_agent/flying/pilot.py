"""The pilot: does what `mission` decides, and records the beginning and end of each step.

The event of a step's end says where the drone is, and holds the evidence of a hand-over.
"""

import asyncio
from collections.abc import Awaitable, Callable, Collection
from dataclasses import replace
from datetime import datetime
from typing import Any, Never

from skyway.contracts.drone_report import Failsafe
from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PickUpStep,
    ReturnStep,
    awaited_ids,
    end_of,
    packages_of,
)
from skyway.contracts.message import utc_text
from skyway.ids import PackageId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_drone_agent.failsafes.faults import in_words
from skyway_drone_agent.flying.mission import Begin, Cut, End, Fail, Gates, Land, Stand, next_act
from skyway_drone_agent.journal.flight_recorder import (
    FlightRecorder,
    NewsOrMoment,
    wait_for_end_or_news,
)
from skyway_drone_agent.journal.journal import JournalUnwritable
from skyway_drone_agent.journal.logbook import Escape, Logbook, run_under_way
from skyway_drone_agent.journal.records import StepBegun
from skyway_drone_agent.link.events import EventWriter
from skyway_drone_agent.vehicle import EnergyUse, Outcome, StepRun, Vehicle, wait_ends_at

#: Seconds between two attempts to write the journal: of fleet time, or of wall time if longer.
_WRITE_AGAIN_S = 1.0

#: The fields of an event that describe a step's end. Any: each has another type.
_EndFields = dict[str, Any]


class Pilot:
    """Flies one drone's missions, one after another."""

    def __init__(
        self,
        recorder: FlightRecorder,
        vehicle: Vehicle,
        clock: FleetClock,
        *,
        gates: Callable[[], Gates],
        energy_use: EnergyUse,
        events: EventWriter,
    ) -> None:
        self._recorder = recorder
        self._vehicle = vehicle
        self._clock = clock
        self._gates = gates
        self._energy_use = energy_use
        self._events = events
        self._news = recorder.watch()
        self._standing = NewsOrMoment(self._news, clock)
        self._started_at = clock.now()
        #: A step that an earlier agent began; it may have ended while no agent ran.
        self._left_behind = run_under_way(recorder.logbook)
        #: When the hand-over began whose wait for proofs this agent has reported.
        self._awaited_since: datetime | None = None

    async def run(self) -> Never:
        """Fly for ever."""
        with self._standing:
            while True:
                try:
                    await self._act()
                except JournalUnwritable:
                    # A step that is not written does not begin.
                    pause = fleet_margin(self._clock, fleet_s=_WRITE_AGAIN_S, wall_s=_WRITE_AGAIN_S)
                    await self._standing.wait(until=self._clock.now() + pause)

    async def _act(self) -> None:
        act = next_act(
            self._recorder.logbook,
            vehicle=self._vehicle,
            now=self._clock.now(),
            gates=self._gates(),
            agent_started_at=self._started_at,
            energy_use=self._energy_use,
        )
        match act:
            case Stand(until=until):
                await self._standing.wait(until=until)
            case Begin():
                self._begin(act)
            case StepRun():
                self._report_wait(act)
                if not self._recall(act):
                    await self._end(act, self._vehicle.perform(act))
            case Land(run=run):
                await self._end(run, self._vehicle.land(run))
            case Cut(run=run, at=at, revision=revision):
                self._end_cut(run, self._vehicle.cut(run, at), revision=revision)
            case Fail():
                self._fail(act)
            case End(at=at):
                self._events.write(self._events.event("MISSION_ENDED", at))

    def _report_wait(self, run: StepRun) -> None:
        """Report once that the drone waits for proofs; again after a restart."""
        if wait_ends_at(run) is None or self._awaited_since == run.started_at:
            return
        self._awaited_since = run.started_at
        awaited = self._events.event("HAND_OVER_AWAITED", self._clock.now(), step=run.step)
        fields = {"started_at": run.started_at, "package_ids": awaited_ids(run.step)}
        self._events.write(awaited.model_copy(update=fields))

    def _recall(self, run: StepRun) -> bool:
        """Whether this ends a hand-over that an earlier agent began."""
        is_left_behind, self._left_behind = run == self._left_behind, None
        if not is_left_behind or not _is_hand_over(run):
            return False
        was_done = self._vehicle.recall(run)
        if was_done is False:
            return False
        outcome = replace(self._vehicle.cut(run, self._clock.now()), code=None)
        if was_done is None:
            outcome = replace(outcome, code="UNKNOWN", has_failed=True)
        self._write_end(run, outcome)
        return True

    async def _performed(self, run: StepRun, doing: Awaitable[Outcome]) -> Outcome | None:
        """How the step ended; None when an instruction or a failsafe has changed or cut it."""
        performing = asyncio.ensure_future(doing)
        try:
            # A change of the step counts before its end: the change is already in the journal.
            while run_under_way(self._recorder.logbook) == run:
                if performing.done():
                    return performing.result()
                await wait_for_end_or_news(performing, self._news)
            return None
        finally:
            performing.cancel()

    def _begin(self, act: Begin) -> None:
        begun = StepBegun(
            step_id=act.step.step_id,
            started_at=act.at,
            released_through=act.released_through,
        )
        if self._recorder.logbook.is_airborne:
            # In the air the drone cannot wait for the disk.
            self._recorder.note(begun)
        else:
            self._recorder.record(begun)

    async def _end(self, run: StepRun, doing: Awaitable[Outcome]) -> None:
        outcome = await self._performed(run, doing)
        if outcome is not None:
            self._write_end(run, outcome)

    def _write_end(self, run: StepRun, outcome: Outcome) -> None:
        ended = self._events.event("STEP_ENDED", outcome.ended_at, step=run.step)
        fields = _end_of_step(run, outcome, self._recorder.logbook)
        self._events.write(ended.model_copy(update=fields))

    def _end_cut(self, run: StepRun, outcome: Outcome, *, revision: int) -> None:
        """Record the end of a step that is no longer in the plan; no package was handed over."""
        ended = self._events.event("STEP_ENDED", outcome.ended_at, step=run.step)
        changes = {
            "mission_revision": revision,
            "started_at": run.started_at,
            "soc": outcome.soc,
            "code": outcome.code,
        }
        self._events.write(ended.model_copy(update=changes))

    def _fail(self, act: Fail) -> None:
        failed = self._events.event("STEP_FAILED", act.at, step=act.step)
        self._events.write(failed.model_copy(update={"code": act.code, "data": act.data}))


def _is_hand_over(run: StepRun) -> bool:
    """Whether packages may be handed over now, without waiting for a loader or for proofs."""
    if isinstance(run.step, PickUpStep):
        return not run.step.awaits_confirmation
    return isinstance(run.step, DeliverStep | ReturnStep) and wait_ends_at(run) is None


def _evidence_of(
    step: FlightStep, handed: Collection[PackageId], logbook: Logbook, *, at: datetime
) -> dict[str, object]:
    """Place, moment and weights of a hand-over, as an event's `data`."""
    if isinstance(step, PickUpStep):
        packages, sign = step.packages, 1
    else:
        packages, sign = tuple(one for one in logbook.packages if one.package_id in handed), -1
    mass_kg = {package.package_id: package.mass_kg for package in packages}
    return {
        "place": {"station_id": end_of(step), "position": list(logbook.position)},
        "at": utc_text(at),
        "mass_kg": mass_kg,
        "load_before_kg": logbook.load_kg,
        "load_after_kg": max(0.0, logbook.load_kg + sign * sum(mass_kg.values())),
    }


def _end_of_step(run: StepRun, outcome: Outcome, logbook: Logbook) -> _EndFields:
    """The end of the step under way: as planned, failed, or where a failsafe led the drone."""
    mission, step = logbook.mission, run.step
    before = mission.flown_before if mission else None
    fields: _EndFields = {
        "event": "STEP_FAILED" if outcome.has_failed else "STEP_ENDED",
        "started_at": before.since if before else run.started_at,
        "station_id": end_of(step),
        "position": step.to_position if isinstance(step, FlyStep) else run.position,
        "soc": outcome.soc,
        "energy_j": outcome.energy_j + (before.used_j if before else 0.0),
        "code": outcome.code,
    }
    escape = mission.escape if mission else None
    if escape is not None and isinstance(step, FlyStep) and escape.leads_back(step):
        # The drone lands as planned, and goes on with its plan.
        escape = None
    if escape is not None:
        fields |= _escaped(escape)
    if outcome.elsewhere is not None:
        place = outcome.elsewhere
        fields |= {"station_id": place.station_id, "position": place.position}
    if escape is not None:
        return fields
    handed = outcome.handed_ids if outcome.has_failed else packages_of(step)
    return fields | _hand_over(step, handed, logbook, at=outcome.ended_at)


def _escaped(escape: Escape) -> _EndFields:
    fields: _EndFields = {
        "event": "STEP_FAILED",
        "code": escape.fault.value,
        "detail": in_words(escape.fault, escape.failsafe),
    }
    if escape.failsafe is Failsafe.LAND_NOW:
        fields |= {"station_id": None}
    return fields


def _hand_over(
    step: FlightStep, handed: tuple[PackageId, ...], logbook: Logbook, *, at: datetime
) -> _EndFields:
    """The packages that changed hands and the evidence; empty without packages."""
    if not handed:
        return {}
    return {"package_ids": handed, "data": _evidence_of(step, handed, logbook, at=at)}
