"""The pilot: does what `mission` decides, and writes down each beginning and end."""

import logging
from collections.abc import Callable
from datetime import datetime
from typing import Never

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, FlightStep, FlyStep, PickUpStep, ReturnStep
from skyway.ids import PackageId
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.flight_recorder import FlightRecorder
from skyway_drone_agent.mission import Begin, End, Fail, Gates, Stand, next_act
from skyway_drone_agent.records import EventRecorded, StepBegun
from skyway_drone_agent.step_places import end_of
from skyway_drone_agent.uplink import Uplink
from skyway_drone_agent.vehicle import Outcome, StepRun, Vehicle
from skyway_drone_agent.waiting import wait_for_news

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
                self._end(act, await self._vehicle.perform(act))
            case Fail():
                self._fail(act)
            case End(at=at):
                self._write(self._event("MISSION_ENDED", at, step=None))

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
        ended = self._event("STEP_ENDED", outcome.ended_at, step=step)
        self._write(
            ended.model_copy(
                update={
                    "started_at": run.started_at,
                    "station_id": end_of(step),
                    "position": step.to_position if isinstance(step, FlyStep) else run.position,
                    "soc": outcome.soc,
                    "energy_j": outcome.energy_j,
                    "package_ids": _handed_over(step),
                    "code": outcome.code,
                    "data": self._weights(step),
                }
            )
        )

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

    def _weights(self, step: FlightStep) -> dict[str, object]:
        """Evidence of a hand-over: what each package weighs, and the load before and after."""
        logbook = self._recorder.logbook
        handed_over = set(_handed_over(step))
        if isinstance(step, PickUpStep):
            packages, sign = step.packages, 1
        elif handed_over:
            packages = tuple(one for one in logbook.packages if one.package_id in handed_over)
            sign = -1
        else:
            return {}
        mass_kg = {package.package_id: package.mass_kg for package in packages}
        after_kg = max(0.0, logbook.load_kg + sign * sum(mass_kg.values()))
        return {
            "mass_kg": mass_kg,
            "load_before_kg": logbook.load_kg,
            "load_after_kg": after_kg,
        }


def _handed_over(step: FlightStep) -> tuple[PackageId, ...]:
    if isinstance(step, PickUpStep):
        return tuple(package.package_id for package in step.packages)
    if isinstance(step, DeliverStep | ReturnStep):
        return step.package_ids
    return ()
