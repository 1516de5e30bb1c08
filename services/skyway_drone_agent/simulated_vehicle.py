"""A drone that exists only as physics: the same `skyway.drone` that the planner plans with."""

import asyncio
from datetime import datetime, timedelta

from skyway.contracts.flight_step import (
    DeliverStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.drone.charging import recharge_time_s, soc_after_recharge
from skyway.drone.flight import flight_energy_j, flight_time_s, speed_mps
from skyway.drone.model import DroneModel
from skyway.drone.power import flight_power_w
from skyway.geo import point_between
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.vehicle import Outcome, Sample, StepRun

#: Planned moments and pad reservations are whole milliseconds, rounded once each: a charge that
#: lacks less than this is not short.
_RESERVATION_GRAIN = timedelta(milliseconds=2)


class SimulatedVehicle:
    """Performs steps by computing when they end, and waiting until then."""

    def __init__(self, model: DroneModel, clock: FleetClock) -> None:
        self._model = model
        self._clock = clock

    @property
    def model(self) -> DroneModel:
        """The type of drone."""
        return self._model

    async def perform(self, run: StepRun) -> Outcome:
        """Wait until the step's computed end, which does not depend on when we wake."""
        if isinstance(run.step, PickUpStep) and run.step.awaits_confirmation:
            # A loader confirms to the cloud, and the cloud with an instruction.
            await asyncio.Event().wait()
        outcome = outcome_of(run, self._model)
        await self._clock.sleep_until(outcome.ended_at)
        return outcome

    def cut(self, run: StepRun, at: datetime) -> Outcome:
        """End a step on the ground at this moment, or when it ended by itself before."""
        ended_at = at
        if not (isinstance(run.step, PickUpStep) and run.step.awaits_confirmation):
            ended_at = min(at, outcome_of(run, self._model).ended_at)
        soc = self.sample(run, ended_at).soc
        return Outcome(ended_at, soc, energy_j=0.0, code="CUT")

    def sample(self, run: StepRun, at: datetime) -> Sample:
        """How far the step has come at this moment."""
        elapsed_s = max(0.0, (at - run.started_at).total_seconds())
        if isinstance(run.step, FlyStep):
            return _in_flight(run, run.step, model=self._model, elapsed_s=elapsed_s)
        soc = run.soc
        if isinstance(run.step, RechargeStep) and soc < run.step.until_soc:
            on_curve = max(soc, self._model.charge_curve[0].soc)
            soc = min(soc_after_recharge(self._model, on_curve, elapsed_s), run.step.until_soc)
        return Sample(run.position, soc, power_w=0.0, speed_mps=0.0)


def outcome_of(run: StepRun, model: DroneModel) -> Outcome:
    """When and how a step ends, by the planner's arithmetic."""
    match run.step:
        case FlyStep():
            return _flown(run, run.step, model=model)
        case RechargeStep():
            return _recharged(run, run.step, model=model)
        case WaitStep(until_at=until_at):
            return Outcome(max(run.started_at, until_at), run.soc, energy_j=0.0)
        case DeliverStep(dropoff_s=dropoff_s):
            return Outcome(run.started_at + timedelta(seconds=dropoff_s), run.soc, energy_j=0.0)
        case PickUpStep() | ReturnStep():
            planned = run.step.planned_end_at - run.step.planned_start_at
            return Outcome(_no_earlier(run, run.started_at + planned), run.soc, energy_j=0.0)


def _no_earlier(run: StepRun, ended_at: datetime) -> datetime:
    """The end of a step, which cannot lie before it was changed."""
    return ended_at if run.changed_at is None else max(ended_at, run.changed_at)


def _flown(run: StepRun, step: FlyStep, *, model: DroneModel) -> Outcome:
    duration_s = flight_time_s(model, length_m=step.length_m, load_kg=run.load_kg)
    energy_j = flight_energy_j(model, length_m=step.length_m, load_kg=run.load_kg)
    if step.lands:
        duration_s += model.stop_s
        energy_j += model.stop_j
    over_at = run.started_at + timedelta(seconds=duration_s)
    ended_at = _no_earlier(run, over_at)
    if ended_at > over_at:
        # Called back up while it was landing.
        energy_j += model.stop_j * min(1.0, (ended_at - over_at).total_seconds() / model.stop_s)
    return Outcome(ended_at, max(0.0, run.soc - energy_j / model.battery_j), energy_j)


def _recharged(run: StepRun, step: RechargeStep, *, model: DroneModel) -> Outcome:
    until_soc = min(step.until_soc, model.top_soc)
    if run.soc >= until_soc:
        return Outcome(run.started_at, run.soc, energy_j=0.0)
    soc = max(run.soc, model.charge_curve[0].soc)
    full_at = run.started_at + timedelta(seconds=recharge_time_s(model, soc, until_soc))
    if full_at <= step.not_after_at + _RESERVATION_GRAIN:
        return Outcome(full_at, until_soc, energy_j=0.0)
    ended_at = max(run.started_at, step.not_after_at)
    duration_s = (ended_at - run.started_at).total_seconds()
    short_soc = soc_after_recharge(model, soc, duration_s)
    return Outcome(ended_at, short_soc, energy_j=0.0, code="SHORT_CHARGE")


def _in_flight(run: StepRun, step: FlyStep, *, model: DroneModel, elapsed_s: float) -> Sample:
    flight_s = flight_time_s(model, length_m=step.length_m, load_kg=run.load_kg)
    fraction = min(1.0, elapsed_s / flight_s)
    used_j = fraction * flight_energy_j(model, length_m=step.length_m, load_kg=run.load_kg)
    return Sample(
        position=point_between(step.from_position, step.to_position, fraction=fraction),
        soc=max(0.0, run.soc - used_j / model.battery_j),
        power_w=flight_power_w(model, run.load_kg),
        speed_mps=speed_mps(model, run.load_kg) if fraction < 1.0 else 0.0,
    )
