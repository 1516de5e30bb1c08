"""The pilot: does what `mission` decides, and writes down each beginning and end."""

import asyncio
import logging
from collections.abc import Callable
from datetime import datetime
from typing import Never

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.flight_recorder import FlightRecorder
from skyway_drone_agent.mission import Begin, Cut, End, Fail, Gates, Stand, next_act
from skyway_drone_agent.proof import handed_over, proof_of
from skyway_drone_agent.records import EventRecorded, StepBegun
from skyway_drone_agent.step_places import end_of
from skyway_drone_agent.uplink import Uplink
from skyway_drone_agent.vehicle import Outcome, StepRun, Vehicle, run_under_way
from skyway_drone_agent.waiting import wait_for_end_or_news, wait_for_news

log = logging.getLogger(__name__)


class Pilot:
    """Flies one drone's missions, one after another."""

    def __init__(
        self,
        recorder: FlightRecorder,
        vehicle: Vehicle,
        clock: FleetClock,
        *,
        gates: Callable[[], Gates],
        uplink: Uplink,
    ) -> None:
        self._recorder = recorder
        self._vehicle = vehicle
        self._clock = clock
        self._gates = gates
        self._uplink = uplink
        self._news = recorder.watch()
        self._started_at = clock.now()

    async def run(self) -> Never:
        """Fly for ever."""
        while True:
            await self._act()

    async def _act(self) -> None:
        act = next_act(
            self._recorder.logbook,
            vehicle=self._vehicle,
            now=self._clock.now(),
            gates=self._gates(),
            agent_started_at=self._started_at,
        )
        match act:
            case Stand(until=until):
                await wait_for_news(self._news, self._clock, until=until)
            case Begin():
                self._begin(act)
            case StepRun():
                outcome = await self._performed(act)
                if outcome is not None:
                    self._end(act, outcome)
            case Cut(run=run, at=at, revision=revision):
                self._end_cut(run, self._vehicle.cut(run, at), revision=revision)
            case Fail():
                self._fail(act)
            case End(at=at):
                self._write(self._event("MISSION_ENDED", at, step=None))

    async def _performed(self, run: StepRun) -> Outcome | None:
        """How the step ended; None once an instruction has changed or cut it."""
        performing = asyncio.ensure_future(self._vehicle.perform(run))
        try:
            # What has come meanwhile counts before the end does: it is in the journal already.
            while run_under_way(self._recorder.logbook) == run:
                if performing.done():
                    return performing.result()
                await wait_for_end_or_news(performing, self._news)
            return None
        finally:
            performing.cancel()

    def _begin(self, act: Begin) -> None:
        self._recorder.record(
            StepBegun(
                step_id=act.step.step_id,
                started_at=act.at,
                released_through=act.released_through,
            )
        )

    def _end(self, run: StepRun, outcome: Outcome) -> None:
        step = run.step
        kind = "STEP_FAILED" if outcome.has_failed else "STEP_ENDED"
        ended = self._event(kind, outcome.ended_at, step=step)
        changes = {
            "started_at": run.started_at,
            "station_id": end_of(step),
            "position": step.to_position if isinstance(step, FlyStep) else run.position,
            "soc": outcome.soc,
            "energy_j": outcome.energy_j,
            "code": outcome.code,
        }
        if not outcome.has_failed:
            changes |= self._hand_over(step, outcome.ended_at)
        self._write(ended.model_copy(update=changes))

    def _end_cut(self, run: StepRun, outcome: Outcome, *, revision: int) -> None:
        """The end of a step that is no more in the plan: nothing was handed over."""
        ended = self._event("STEP_ENDED", outcome.ended_at, step=run.step)
        changes = {
            "mission_revision": revision,
            "started_at": run.started_at,
            "soc": outcome.soc,
            "code": outcome.code,
        }
        self._write(ended.model_copy(update=changes))

    def _fail(self, act: Fail) -> None:
        failed = self._event("STEP_FAILED", act.at, step=act.step)
        self._write(failed.model_copy(update={"code": act.code, "data": act.data}))

    def _event(self, kind: str, ended_at: datetime, *, step: FlightStep | None) -> DroneEvent:
        """An event of the current mission, at the place where the drone stands."""
        logbook = self._recorder.logbook
        mission = logbook.mission
        return DroneEvent.model_validate(
            {
                **self._uplink.envelope_with(logbook.last_event_seq + 1),
                "traceparent": mission.accepted_by.traceparent if mission else None,
                "event": kind,
                "stream": logbook.stream,
                "mission_id": mission.mission_id if mission else None,
                "mission_revision": mission.revision if mission else None,
                "step_id": step.step_id if step else None,
                "step_kind": step.kind if step else None,
                "ended_at": ended_at,
                "station_id": logbook.station_id,
                "position": logbook.position,
                "soc": logbook.soc,
            }
        )

    def _write(self, event: DroneEvent) -> None:
        self._recorder.record(EventRecorded(event=event))
        log.info(
            "drone event",
            extra={
                "drone_id": self._recorder.drone_id,
                "event_kind": event.event,
                "mission_id": event.mission_id,
                "step_id": event.step_id,
                "code": event.code,
            },
        )

    def _hand_over(self, step: FlightStep, at: datetime) -> dict[str, object]:
        """The packages of a hand-over, and its evidence; nothing for other steps."""
        package_ids = handed_over(step)
        if not package_ids:
            return {}
        return {"package_ids": package_ids, "data": proof_of(step, self._recorder.logbook, at=at)}
