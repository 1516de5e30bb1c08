"""A real drone: its autopilot (PX4, ArduPilot) flies what the agent releases, over MAVLink."""

import asyncio
import logging
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.flight_step import (
    DeliverStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.drone.flight import speed_mps
from skyway.drone.model import DroneModel
from skyway.runtime.clock import FleetClock, sleep_wall
from skyway_drone_agent.mavlink.autopilot import Autopilot
from skyway_drone_agent.mavlink.flight import MavlinkFlight, begin_flight
from skyway_drone_agent.mavlink.link import MavlinkLink, command, command_once
from skyway_drone_agent.mavlink.mission import MissionRefused
from skyway_drone_agent.mavlink.settings import MavlinkSettings
from skyway_drone_agent.vehicle import (
    Elsewhere,
    Outcome,
    Reading,
    Sample,
    Standing,
    StepRun,
    wait_ends_at,
)

log = logging.getLogger(__name__)


class Releases:
    """Remembers the newest hand-over; number and start identify a step."""

    def __init__(self, link: MavlinkLink, clock: FleetClock, settings: MavlinkSettings) -> None:
        self._link = link
        self._clock = clock
        self._settings = settings
        self._newest: tuple[tuple[int, datetime], asyncio.Task[bool | None]] | None = None

    async def release(self, run: StepRun) -> bool | None:
        """Whether the autopilot has dropped the packages of this step; None if that is unknown."""
        if self._newest is None or self._newest[0] != _key(run):
            self._newest = (_key(run), asyncio.create_task(self._let_go()))
        # Shielded: a step that continues after a cancel waits for the same release.
        return await asyncio.shield(self._newest[1])

    def result_of(self, run: StepRun) -> bool | None:
        """Whether this process has seen the hand-over done; autopilots do not remember it."""
        if self._newest is None or self._newest[0] != _key(run) or not self._newest[1].done():
            return None
        return self._newest[1].result()

    async def _let_go(self) -> bool | None:
        dialect = self._link.dialect
        command_id, *params = self._settings.payload.command(dialect)
        while True:
            result = await command_once(
                self._link, int(command_id), *params, timeout_s=self._settings.release_s
            )
            if result == dialect.MAV_RESULT_TEMPORARILY_REJECTED:
                await sleep_wall(self._clock, _AGAIN_S)
                continue
            return None if result is None else result == dialect.MAV_RESULT_ACCEPTED


def _key(run: StepRun) -> tuple[int, datetime]:
    return run.step.step_id, run.started_at


#: A drone this close to a station stands at it.
_AT_STATION_M: Final = 30.0

#: A charge that is short by this much counts as reached: autopilots report whole percents.
_CHARGE_GRAIN: Final = 0.005

#: Wall seconds between two tries of a refused command that must succeed: in the air, or a release.
_AGAIN_S: Final = 2.0

#: Wall seconds that an autopilot may take to answer an optional request.
_ASKED_S: Final = 1.0

#: Microseconds between two messages of each kind that the autopilot should send.
_EVERY_US: Final = 500_000


class MavlinkVehicle:
    """Performs steps by instructing an autopilot, and by reading its messages.

    The fleet clock must run at rate 1: air does not run faster.
    """

    def __init__(
        self, model: DroneModel, clock: FleetClock, link: MavlinkLink, settings: MavlinkSettings
    ) -> None:
        self._model = model
        self._clock = clock
        self._link = link
        self._settings = settings
        self._autopilot = Autopilot(model, link.dialect, clock)
        link.listen(self._autopilot.handle)
        self._flight: MavlinkFlight | None = None
        self._releases = Releases(link, clock, settings)
        self._asking: asyncio.Task[None] | None = None

    @property
    def model(self) -> DroneModel:
        """The type of drone."""
        return self._model

    async def ready(self) -> None:
        """Wait for the autopilot's first message, then ask for the messages that we need."""
        await self._link.target()
        await self._ask()
        await self._autopilot.until(lambda: self._autopilot.has_reported)

    async def _ask(self) -> None:
        dialect = self._link.dialect
        for message_id in (
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
            dialect.MAVLINK_MSG_ID_VFR_HUD,
            dialect.MAVLINK_MSG_ID_BATTERY_STATUS,
            dialect.MAVLINK_MSG_ID_SYS_STATUS,
            dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
            dialect.MAVLINK_MSG_ID_GPS_RAW_INT,
            dialect.MAVLINK_MSG_ID_GPS2_RAW,
            dialect.MAVLINK_MSG_ID_MISSION_CURRENT,
            dialect.MAVLINK_MSG_ID_WIND_COV,
        ):
            # Some autopilots lack some of these messages: a refusal changes nothing here.
            interval = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
            await command_once(self._link, interval, message_id, _EVERY_US, timeout_s=_ASKED_S)

    async def perform(self, run: StepRun) -> Outcome:
        """Do the step and return at its end; a call with the same run continues the step."""
        match run.step:
            case FlyStep():
                return await self._fly(run, run.step)
            case WaitStep(until_at=until_at):
                await self._clock.sleep_until(until_at)
                return self._ended(run)
            case RechargeStep():
                return await self._recharge(run, run.step)
            case PickUpStep(awaits_confirmation=True):
                # A loader confirms to the cloud, and the cloud with an instruction.
                await asyncio.Event().wait()
                return self._ended(run)
            case PickUpStep():
                await self._planned_end(run)
                return self._ended(run)
            case DeliverStep() | ReturnStep():
                if (given_up_at := wait_ends_at(run)) is not None:
                    # The cloud says when the proofs are there. One release drops all packages of
                    # the step, so that none may be dropped before the last proof.
                    await self._clock.sleep_until(given_up_at)
                    return _failed(self._ended(run), code="RECIPIENT_ABSENT")
                return await self._hand_over(run)

    def cut(self, run: StepRun, at: datetime) -> Outcome:
        """End a step on the ground at this moment."""
        return Outcome(max(at, run.started_at), self._soc(run), energy_j=0.0, code="CUT")

    def sample(self, run: StepRun, at: datetime) -> Sample:
        """The last values that the autopilot reported."""
        autopilot = self._autopilot
        return Sample(
            position=autopilot.position or run.position,
            soc=self._soc(run),
            power_w=autopilot.power_w,
            speed_mps=autopilot.speed_mps,
        )

    def read(self, doing: StepRun | Standing, at: datetime) -> Reading:
        """The last values that the autopilot reported, as one reading."""
        reading = self._autopilot.reading(at, last_position=doing.position, last_soc=doing.soc)
        is_complete = reading.has_gps and reading.has_battery
        if not is_complete and (self._asking is None or self._asking.done()):
            # An autopilot that has restarted sends nothing until it is asked again.
            self._asking = asyncio.create_task(self._ask())
        return reading

    async def land(self, run: StepRun) -> Outcome:
        """End a flight here and now, and return once the drone is down."""
        self._flight = None
        while not self._autopilot.is_on_ground:
            await command(self._link, self._link.dialect.MAV_CMD_NAV_LAND)
            await self._autopilot.until(lambda: self._autopilot.is_on_ground, timeout_s=_AGAIN_S)
        here = self._autopilot.position or run.position
        return replace(self._ended(run), elsewhere=Elsewhere(None, here))

    def recall(self, run: StepRun) -> bool | None:
        """Whether this process has seen the hand-over done."""
        return self._releases.result_of(run)

    async def photograph(self) -> None:
        """No picture: the agent reads no camera of an autopilot."""

    async def _fly(self, run: StepRun, step: FlyStep) -> Outcome:
        route = (step, *run.onward)
        if self._flight is None or not self._flight.goes_on_with(route):
            if self._has_arrived(route):
                return self._ended(run)
            refusal = await self._begin(run, route)
            if refusal is not None:
                return refusal
        if self._flight is not None:
            await self._flight.end_of(step)
        ended = self._ended(run)
        is_down = self._autopilot.is_on_ground
        place = self._autopilot.position
        if not is_down or place is None or self._has_arrived(route):
            return ended
        # The drone's own failsafes or a pilot have brought it down.
        log.warning("landed elsewhere", extra={"step_id": step.step_id})
        return _failed(ended, code="LANDED_ELSEWHERE", elsewhere=Elsewhere(None, place))

    async def _begin(self, run: StepRun, route: tuple[FlyStep, ...]) -> Outcome | None:
        """Make the autopilot fly; on the ground it may refuse, in the air it is asked again."""
        while True:
            self._flight = None
            try:
                self._flight = await begin_flight(
                    self._link,
                    self._autopilot,
                    route,
                    altitude_m=self._settings.altitude_m,
                    speed_mps=speed_mps(self._model, run.load_kg),
                )
            except MissionRefused as error:
                log.warning("flight refused", extra={"reason": str(error)})
                if self._autopilot.is_on_ground:
                    here = Elsewhere(route[0].from_id, run.position)
                    return _failed(self._ended(run), code="AUTOPILOT_REFUSED", elsewhere=here)
                await sleep_wall(self._clock, _AGAIN_S)
            else:
                return None

    def _has_arrived(self, route: tuple[FlyStep, ...]) -> bool:
        """Whether the drone stands where these flights lead, also after a restart."""
        autopilot, end = self._autopilot, route[-1].to_position
        return autopilot.is_on_ground and autopilot.is_near(end, within_m=_AT_STATION_M)

    async def _recharge(self, run: StepRun, step: RechargeStep) -> Outcome:
        until_soc = min(step.until_soc, self._model.top_soc) - _CHARGE_GRAIN
        charging = asyncio.ensure_future(self._autopilot.until(lambda: self._soc(run) >= until_soc))
        over = asyncio.ensure_future(self._clock.sleep_until(step.not_after_at))
        try:
            await asyncio.wait((charging, over), return_when=asyncio.FIRST_COMPLETED)
        finally:
            charging.cancel()
            over.cancel()
        code = None if self._soc(run) >= until_soc else "SHORT_CHARGE"
        return Outcome(max(self._clock.now(), run.started_at), self._soc(run), 0.0, code)

    async def _hand_over(self, run: StepRun) -> Outcome:
        was_done = await self._releases.release(run)
        if was_done is None:
            return _failed(self._ended(run), code="UNKNOWN")
        if not was_done:
            return _failed(self._ended(run), code="HAND_OVER_REFUSED")
        await self._planned_end(run)
        return self._ended(run)

    async def _planned_end(self, run: StepRun) -> None:
        planned = run.step.planned_end_at - run.step.planned_start_at
        if isinstance(run.step, DeliverStep):
            planned = timedelta(seconds=run.step.dropoff_s)
        await self._clock.sleep_until((run.changed_at or run.started_at) + planned)

    def _ended(self, run: StepRun) -> Outcome:
        soc = self._soc(run)
        used_j = max(0.0, run.soc - soc) * self._model.battery_j
        return Outcome(max(self._clock.now(), run.started_at), soc, used_j)

    def _soc(self, run: StepRun) -> float:
        return self._autopilot.least_soc(run.soc)


async def ready_vehicle(
    model: DroneModel, clock: FleetClock, link: MavlinkLink, settings: MavlinkSettings
) -> MavlinkVehicle:
    """The drone whose autopilot is at the other end, once it has reported its position."""
    log.info("waiting for the autopilot", extra={"address": settings.address})
    vehicle = MavlinkVehicle(model, clock, link, settings)
    await vehicle.ready()
    return vehicle


def _failed(ended: Outcome, *, code: str, elsewhere: Elsewhere | None = None) -> Outcome:
    return replace(ended, code=code, has_failed=True, elsewhere=elsewhere)
