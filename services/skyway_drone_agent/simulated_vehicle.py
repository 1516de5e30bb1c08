"""A drone that exists only as physics: the same `skyway.drone` that the planner plans with."""

import asyncio
from datetime import datetime

from skyway.contracts.flight_step import PickUpStep
from skyway.drone.model import DroneModel
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.disturbances import UNDISTURBED, Disturbances
from skyway_drone_agent.simulated_physics import Physics
from skyway_drone_agent.vehicle import Outcome, Sample, StepRun


class SimulatedVehicle:
    """Performs steps by computing when they end, and waiting until then."""

    def __init__(
        self, model: DroneModel, clock: FleetClock, *, disturbances: Disturbances = UNDISTURBED
    ) -> None:
        self._physics = Physics(model, disturbances)
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


def _awaits_confirmation(run: StepRun) -> bool:
    return isinstance(run.step, PickUpStep) and run.step.awaits_confirmation
