"""The real world of a rehearsal: where the drone and its packages truly are, also after a crash.

A step that has begun goes on by physics, whether the agent's process lives or not; so a second
hand-over, a package from nowhere or a battery that fills by itself shows, even when
journals hide it.
"""

from collections.abc import Iterable
from datetime import datetime, timedelta

from skyway_drone_agent.journal.logbook import run_under_way
from skyway_drone_agent.journal.records import EventRecorded, FailsafeBegun, FaultEnded
from skyway_drone_agent.simulated.disturbances import Disturbances
from skyway_drone_agent.simulated.physics import Physics
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import Outcome, StepRun

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
)
from skyway.geo import distance_m
from tests.drone_agent.simulation.rehearsal.disk import Disk
from tests.drone_agent.simulation.rehearsal.findings import Findings
from tests.drone_agent.simulation.rehearsal.low_landings import BATTERY_FAULTS
from tests.drone_agent.simulation.rehearsal.places import DRONE, MODEL
from tests.drone_agent.simulation.rehearsal.plan import leg_j
from tests.drone_agent.simulation.rehearsal.virtual_time import VirtualClock

#: Rounding of a charge.
_SOC_ROUNDING = 1e-6

#: Charge below the reserve at which a failsafe must have acted: the estimate may err so much.
_UNSEEN_SOC = 0.03

#: How well a drone knows what its battery holds, once it has found out.
_KNOWN_HEALTH = 0.05


class Yard:
    """The drone and its packages."""

    def __init__(
        self, disturbances: Disturbances, clock: VirtualClock, disk: Disk, findings: Findings
    ) -> None:
        self.physics = Physics(MODEL, disturbances, drone_id=DRONE.drone_id)
        self._clock = clock
        self._disk = disk
        self._findings = findings
        #: What a fault must last, and the time between two looks of the guard.
        self._notice = timedelta(seconds=5.0 + max(1.0, 0.25 * clock.rate))
        #: "drone", or "DELIVER" and "RETURN" at a station; what is not here lies at its pickup.
        self.places: dict[str, str] = {}
        self.doing: StepRun | None = None
        self.kinds_begun: list[str] = []
        self._has_effect = False
        self._lands_at: datetime | None = None
        self._hand_overs: dict[int, tuple[str, ...]] = {}

    def begin(self, run: StepRun, *, lands_here: bool = False) -> None:
        """The agent begins or continues this step."""
        self.settle()
        before = self.doing
        if before is None or _key(before) != _key(run):
            self._check_beginning(before, run)
            self.kinds_begun.append(run.step.kind)
            self._has_effect = False
        self.doing = run
        if lands_here:
            self._lands_at = self._clock.now()

    def check_not_repeated(self, run: StepRun) -> None:
        """Check that a hand-over of an earlier process is not repeated if it may be done."""
        was_begun = self.doing is not None and _key(self.doing) == _key(run)
        self._findings.expect(
            not (was_begun and _is_hand_over(run.step)),
            "I6: handed over again, not knowing whether it was done",
            (run.step.kind, run.step.step_id),
        )

    def settle(self) -> None:
        """Apply the effects of the step that have happened by now."""
        run = self.doing
        if run is None or self._has_effect or _awaits_confirmation(run.step):
            return
        outcome = self.physics.outcome_of(run)
        if outcome.ended_at <= self._clock.now():
            self._has_effect = True
            if not outcome.has_failed:
                self._hand_over(run.step)

    def cut(self, step_id: int) -> None:
        """A step was called off before its end, so no package was handed over."""
        run = self.doing
        if run is not None and run.step.step_id == step_id and isinstance(run.step, PickUpStep):
            if self._has_effect and not _awaits_confirmation(run.step):
                for package in run.step.packages:
                    self.places.pop(package.package_id, None)
            self._has_effect = True

    def end(self) -> None:
        """The story is over."""
        self.settle()
        run = self.doing
        if run is not None and isinstance(run.step, FlyStep):
            self._check_charge(run, until=self._clock.now())

    def was_begun(self, run: StepRun) -> bool:
        """Whether the drone has truly begun this, or only its journal says so."""
        if self.doing is None or _key(self.doing) != _key(run):
            return False
        # A loader may have said what is on board just before the power failed.
        self.doing = run
        self.settle()
        return True

    def _hand_over(self, step: FlightStep) -> None:
        match step:
            case PickUpStep():
                package_ids = tuple(one.package_id for one in step.packages)
                self._move_packages(step, package_ids, source=None, target="drone")
            case DeliverStep() | ReturnStep():
                self._move_packages(step, step.package_ids, source="drone", target=step.kind)

    def _move_packages(
        self, step: FlightStep, package_ids: Iterable[str], *, source: str | None, target: str
    ) -> None:
        """Check that handed-over packages were there, unless the drone reported UNKNOWN."""
        self._hand_overs[step.step_id] = tuple(package_ids)
        for package_id in package_ids:
            where = self.places.get(package_id)
            if where == source:
                self.places[package_id] = target
            else:
                self._findings.expect(
                    package_id in self._unknown(),
                    "I6: handed over, but it was not there",
                    (package_id, where, step.kind, step.step_id),
                )

    def _unknown(self) -> set[str]:
        """Packages with a hand-over that the drone has reported as UNKNOWN."""
        return {
            package_id
            for one in self._disk.records
            if isinstance(one, EventRecorded) and one.event.code == "UNKNOWN"
            for package_id in self._hand_overs.get(one.event.step_id or 0, ())
        }

    # What must hold whenever something begins

    def _check_beginning(self, before: StepRun | None, run: StepRun) -> None:
        is_airborne = self._disk.kept.is_airborne
        if not is_airborne:
            known = run_under_way(self._disk.kept)
            self._findings.expect(
                known is not None and _key(known) == _key(run),
                "I7: begun before it was in the journal",
                (run.step.step_id, known),
            )
        if before is not None:
            self._check_continuity(before, run)
            if isinstance(before.step, FlyStep):
                self._check_charge(before, until=run.started_at)
        if isinstance(run.step, FlyStep) and not (
            before is not None and isinstance(before.step, FlyStep) and self._is_flying(before, run)
        ):
            self._check_take_off(run)

    def _is_flying(self, before: StepRun, run: StepRun) -> bool:
        assert isinstance(before.step, FlyStep)
        return not before.step.lands or run.step.step_id == before.step.step_id

    def _check_continuity(self, before: StepRun, run: StepRun) -> None:
        """Check that the drone's charge and position changed only in its steps."""
        if self._disk.has_forgotten or self._lands_at is not None:
            return
        outcome = self.physics.outcome_of(before)
        sample = self.physics.sample(before, min(run.started_at, outcome.ended_at))
        soc, position = sample.soc, sample.position
        if outcome.ended_at <= run.started_at:
            soc = outcome.soc
            if isinstance(before.step, FlyStep):
                position = before.step.to_position
        is_charge_right = run.soc <= soc + _SOC_ROUNDING
        if isinstance(before.step, RechargeStep):
            is_charge_right = is_charge_right and run.soc >= before.soc - _SOC_ROUNDING
        else:
            is_charge_right = is_charge_right and run.soc >= soc - _SOC_ROUNDING
        detail = (before.step.step_id, before.step.kind, run.step.step_id, run.step.kind)
        self._findings.expect(is_charge_right, "charge from nowhere", (*detail, soc, run.soc))
        off_m = distance_m(position, run.position)
        self._findings.expect(off_m < 1.0, "teleported", (*detail, off_m))

    def _check_take_off(self, run: StepRun) -> None:
        mission = self._disk.kept.mission
        if mission is None:
            return
        need_j, load = 0.0, {one.package_id: one.mass_kg for one in self._disk.kept.packages}
        for step in mission.steps:
            match step:
                case RechargeStep():
                    break
                case DeliverStep() | ReturnStep():
                    load = {key: kg for key, kg in load.items() if key not in step.package_ids}
                case FlyStep():
                    load_kg = sum(load.values())
                    need_j += leg_j(step.from_id, step.to_id, load_kg=load_kg, lands=step.lands)
        soc = run.soc - need_j / MODEL.battery_j
        self._findings.expect(
            soc >= MODEL.reserve_soc - 1e-4,
            "I10: took off with a plan below the reserve",
            (run.step.step_id, run.soc, soc),
        )

    def _check_charge(self, flight: StepRun, *, until: datetime) -> None:
        """Check that a charge below the reserve in the air comes only after a failsafe."""
        limit = MODEL.reserve_soc - _UNSEEN_SOC
        if self._has_hidden_wear():
            # Hidden wear makes it unavoidable: the voltage shows the wear too late.
            limit = MODEL.reserve_soc / 2 - _UNSEEN_SOC
        over_at = min(until, self.physics.outcome_of(flight).ended_at)
        if self._soc(flight, over_at) >= limit or self._soc(flight, flight.started_at) < limit:
            return
        earliest, latest = flight.started_at, over_at
        while latest - earliest > timedelta(milliseconds=100):
            middle = earliest + (latest - earliest) / 2
            if self._soc(flight, middle) < limit:
                latest = middle
            else:
                earliest = middle
        self._findings.expect(
            self._has_acted_by(latest + self._notice),
            "I10: below the reserve in the air, and no failsafe had acted",
            (flight.step.step_id, latest, self._soc(flight, over_at)),
        )

    @property
    def has_worn_battery(self) -> bool:
        """Whether the battery holds clearly less than when it was new."""
        return self.physics.battery_j / MODEL.battery_j < 1.0 - _KNOWN_HEALTH

    def _has_hidden_wear(self) -> bool:
        """Whether the battery holds less than the drone has found out so far."""
        truly = self.physics.battery_j / MODEL.battery_j
        return self._disk.kept.state_of_health - truly > _KNOWN_HEALTH

    def _soc(self, flight: StepRun, at: datetime) -> float:
        outcome = self.physics.outcome_of(flight)
        return outcome.soc if at >= outcome.ended_at else self.physics.sample(flight, at).soc

    def _has_acted_by(self, moment: datetime) -> bool:
        acting: set[str] = set()
        for record in self._disk.records:
            match record:
                case EventRecorded(event=event):
                    if event.ended_at > moment:
                        break
                    if event.event == "ALARM" and event.code in BATTERY_FAULTS:
                        acting.add(str(event.code))
                case FailsafeBegun() if record.at <= moment:
                    return True
                case FaultEnded():
                    acting.discard(record.fault.value)
        return bool(acting)


class WatchedVehicle(SimulatedVehicle):
    """A simulated drone in the yard, as one process of its agent holds it."""

    def __init__(self, yard: Yard, clock: VirtualClock, *, remembers: bool) -> None:
        physics = yard.physics
        super().__init__(MODEL, clock, disturbances=physics.disturbances, drone_id=physics.drone_id)
        self._yard = yard
        self._remembers = remembers
        #: What this process has begun itself, or knows not to be done.
        self._may_go_on: set[tuple[object, ...]] = set()

    async def perform(self, run: StepRun) -> Outcome:
        if _key(run) not in self._may_go_on:
            self._yard.check_not_repeated(run)
            self._may_go_on.add(_key(run))
        self._yard.begin(run)
        outcome = await super().perform(run)
        self._yard.settle()
        return outcome

    async def land(self, run: StepRun) -> Outcome:
        self._yard.begin(run, lands_here=True)
        return await super().land(run)

    def recall(self, run: StepRun) -> bool | None:
        was_begun = self._yard.was_begun(run)
        was_done = was_begun and super().recall(run) if self._remembers else None
        if was_done is False:
            self._may_go_on.add(_key(run))
        return was_done


def _key(run: StepRun) -> tuple[object, ...]:
    return run.step.step_id, run.step.kind, run.started_at


def _awaits_confirmation(step: FlightStep) -> bool:
    return isinstance(step, PickUpStep) and step.awaits_confirmation


def _is_hand_over(step: FlightStep) -> bool:
    return isinstance(step, PickUpStep | DeliverStep | ReturnStep) and not _awaits_confirmation(
        step
    )
