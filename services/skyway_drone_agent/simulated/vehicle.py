"""A drone that exists only as physics: the same `skyway.drone` that the planner plans with."""

import asyncio
from datetime import datetime
from typing import Final

from skyway.contracts.flight_step import PickUpStep
from skyway.drone.model import DroneModel
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.simulated.disturbances import UNDISTURBED, Disturbances
from skyway_drone_agent.simulated.physics import Physics
from skyway_drone_agent.simulated.sensors import reading_of
from skyway_drone_agent.vehicle import Outcome, Reading, Sample, Standing, StepRun

#: A drone that needs no luck of its own.
_NOBODY: Final = DroneId("")


class SimulatedVehicle:
    """Performs steps by computing when they end, and waiting until then."""

    def __init__(
        self,
        model: DroneModel,
        clock: FleetClock,
        *,
        disturbances: Disturbances = UNDISTURBED,
        drone_id: DroneId = _NOBODY,
    ) -> None:
        self._physics = Physics(model, disturbances, drone_id=drone_id)
        self._clock = clock

    @property
    def model(self) -> DroneModel:
        """The type of drone."""
        return self._physics.model

    async def perform(self, run: StepRun) -> Outcome:
        """Wait until the step's computed end, which does not depend on when we wake."""
        if _awaits_confirmation(run):
            # A loader confirms to the cloud, and the cloud with an instruction.
            await asyncio.Event().wait()
        outcome = self._physics.outcome_of(run)
        await self._clock.sleep_until(outcome.ended_at)
        return outcome

    def cut(self, run: StepRun, at: datetime) -> Outcome:
        """End a step on the ground at this moment, or when it ended by itself before."""
        if not _awaits_confirmation(run):
            at = min(at, self._physics.outcome_of(run).ended_at)
        return Outcome(at, self._physics.sample(run, at).soc, energy_j=0.0, code="CUT")

    def sample(self, run: StepRun, at: datetime) -> Sample:
        """How far the step has come at this moment."""
        return self._physics.sample(run, at)

    def read(self, doing: StepRun | Standing, at: datetime) -> Reading:
        """What the sensors show at this moment."""
        return reading_of(self._physics, doing, at)

    async def land(self, run: StepRun) -> Outcome:
        """End a flight here and now, wherever that is, and return once the drone is down."""
        outcome = self._physics.landed(run, self._clock.now())
        await self._clock.sleep_until(outcome.ended_at)
        return outcome

    def recall(self, run: StepRun) -> bool | None:
        """A simulated hand-over is done at its end, which a restart does not change."""
        outcome = self._physics.outcome_of(run)
        return outcome.ended_at <= self._clock.now() and not outcome.has_failed


def _awaits_confirmation(run: StepRun) -> bool:
    return isinstance(run.step, PickUpStep) and run.step.awaits_confirmation
