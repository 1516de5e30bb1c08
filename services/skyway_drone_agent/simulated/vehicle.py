"""A simulated drone, with the same physics (`skyway.drone`) that the planner uses."""

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

#: The drone id for chance where no drone is named.
_NO_DRONE: Final = DroneId("")


class SimulatedVehicle:
    """Performs a step by computing when it ends, and waiting until then."""

    def __init__(
        self,
        model: DroneModel,
        clock: FleetClock,
        *,
        disturbances: Disturbances = UNDISTURBED,
        drone_id: DroneId = _NO_DRONE,
    ) -> None:
        self._physics = Physics(model, disturbances, drone_id=drone_id)
        self._clock = clock

    @property
    def model(self) -> DroneModel:
        """The type of drone."""
        return self._physics.model

    async def perform(self, run: StepRun) -> Outcome:
        """Wait until the step's computed end, which does not depend on when this wakes."""
        if _awaits_confirmation(run):
            # A loader confirms to the cloud; then the cloud sends an instruction.
            await asyncio.Event().wait()
        outcome = self._physics.outcome_of(run)
        await self._clock.sleep_until(outcome.ended_at)
        return outcome

    def cut(self, run: StepRun, at: datetime) -> Outcome:
        """End a step on the ground at this moment, or earlier if it ended by itself."""
        if not _awaits_confirmation(run):
            at = min(at, self._physics.outcome_of(run).ended_at)
        return Outcome(at, self._physics.sample(run, at).soc, energy_j=0.0, code="CUT")

    def sample(self, run: StepRun, at: datetime) -> Sample:
        """The progress of the step at this moment."""
        return self._physics.sample(run, at)

    def read(self, doing: StepRun | Standing, at: datetime) -> Reading:
        """What the sensors show at this moment."""
        return reading_of(self._physics, doing, at)

    async def land(self, run: StepRun) -> Outcome:
        """End a flight on the spot, and return once the drone is down."""
        outcome = self._physics.landed(run, self._clock.now())
        await self._clock.sleep_until(outcome.ended_at)
        return outcome

    def recall(self, run: StepRun) -> bool | None:
        """Whether the computed end has passed, which a restart does not change."""
        outcome = self._physics.outcome_of(run)
        return outcome.ended_at <= self._clock.now() and not outcome.has_failed


def _awaits_confirmation(run: StepRun) -> bool:
    return isinstance(run.step, PickUpStep) and run.step.awaits_confirmation
