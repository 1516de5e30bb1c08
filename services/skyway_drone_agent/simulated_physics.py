"""When and how a step ends, and how far it is: the planner's arithmetic, disturbed or not."""

from dataclasses import dataclass
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
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.geo import point_between
from skyway_drone_agent.disturbances import UNDISTURBED, Disturbances
from skyway_drone_agent.vehicle import Outcome, Sample, StepRun

#: Planned moments and pad reservations are whole milliseconds, rounded once each: a charge that
#: lacks less than this is not short.
_RESERVATION_GRAIN = timedelta(milliseconds=2)


@dataclass(frozen=True, slots=True)
class Physics:
    """What a drone of a model can do, and what disturbs it."""

    model: DroneModel
    disturbances: Disturbances = UNDISTURBED

    def outcome_of(self, run: StepRun) -> Outcome:
        """When and how a step ends by itself."""
        match run.step:
            case FlyStep():
                return self._flown(run, run.step)
            case RechargeStep():
                return self._recharged(run, run.step)
            case WaitStep(until_at=until_at):
                return Outcome(max(run.started_at, until_at), run.soc, energy_j=0.0)
            case DeliverStep():
                return self._delivered(run, run.step)
            case PickUpStep() | ReturnStep():
                planned = run.step.planned_end_at - run.step.planned_start_at
                return Outcome(_no_earlier(run, run.started_at + planned), run.soc, energy_j=0.0)

    def sample(self, run: StepRun, at: datetime) -> Sample:
        """How far the step has come at this moment."""
        elapsed_s = max(0.0, (at - run.started_at).total_seconds())
        if isinstance(run.step, FlyStep):
            return self._in_flight(run, run.step, elapsed_s=elapsed_s)
        soc = run.soc
        if isinstance(run.step, RechargeStep) and soc < run.step.until_soc:
            soc = min(self._charged(soc, elapsed_s), run.step.until_soc)
        return Sample(run.position, soc, power_w=0.0, speed_mps=0.0)

    def _flight_s(self, run: StepRun, step: FlyStep) -> float:
        planned_s = flight_time_s(self.model, length_m=step.length_m, load_kg=run.load_kg)
        return planned_s * self.disturbances.flight_time_factor

    def _flight_j(self, run: StepRun, step: FlyStep) -> float:
        planned_j = flight_energy_j(self.model, length_m=step.length_m, load_kg=run.load_kg)
        return planned_j * self.disturbances.flight_energy_factor

    def _charged(self, soc: float, duration_s: float) -> float:
        on_curve = max(soc, self.model.charge_curve[0].soc)
        planned_s = duration_s / self.disturbances.charge_time_factor
        return soc_after_recharge(self.model, on_curve, planned_s)

    def _flown(self, run: StepRun, step: FlyStep) -> Outcome:
        duration_s, energy_j = self._flight_s(run, step), self._flight_j(run, step)
        over_at = run.started_at + timedelta(seconds=duration_s)
        if step.lands:
            ended_at = _no_earlier(run, over_at + timedelta(seconds=self.model.stop_s))
            energy_j += self.model.stop_j
        else:
            ended_at = _no_earlier(run, over_at)
            if ended_at > over_at:
                # Told to fly on while it was landing: what it has spent on that is gone.
                landing_s = (ended_at - over_at).total_seconds()
                energy_j += self.model.stop_j * min(1.0, landing_s / max(self.model.stop_s, 1.0))
        return Outcome(ended_at, max(0.0, run.soc - energy_j / self.model.battery_j), energy_j)

    def _recharged(self, run: StepRun, step: RechargeStep) -> Outcome:
        until_soc = min(step.until_soc, self.model.top_soc)
        if run.soc >= until_soc:
            return Outcome(run.started_at, run.soc, energy_j=0.0)
        soc = max(run.soc, self.model.charge_curve[0].soc)
        charge_s = recharge_time_s(self.model, soc, until_soc)
        charge_s *= self.disturbances.charge_time_factor
        full_at = run.started_at + timedelta(seconds=charge_s)
        if full_at <= step.not_after_at + _RESERVATION_GRAIN:
            return Outcome(full_at, until_soc, energy_j=0.0)
        ended_at = max(run.started_at, step.not_after_at)
        short_soc = self._charged(soc, (ended_at - run.started_at).total_seconds())
        return Outcome(ended_at, short_soc, energy_j=0.0, code="SHORT_CHARGE")

    def _delivered(self, run: StepRun, step: DeliverStep) -> Outcome:
        if step.station_id not in self.disturbances.absent_station_ids:
            ended_at = run.started_at + timedelta(seconds=step.dropoff_s)
            return Outcome(ended_at, run.soc, energy_j=0.0)
        return Outcome(
            run.started_at + timedelta(seconds=step.recipient_wait_s),
            run.soc,
            energy_j=0.0,
            code="RECIPIENT_ABSENT",
            has_failed=True,
        )

    def _in_flight(self, run: StepRun, step: FlyStep, *, elapsed_s: float) -> Sample:
        flight_s, flight_j = self._flight_s(run, step), self._flight_j(run, step)
        fraction = min(1.0, elapsed_s / flight_s)
        return Sample(
            position=point_between(step.from_position, step.to_position, fraction=fraction),
            soc=max(0.0, run.soc - fraction * flight_j / self.model.battery_j),
            power_w=flight_j / flight_s,
            speed_mps=step.length_m / flight_s if fraction < 1.0 else 0.0,
        )


def _no_earlier(run: StepRun, ended_at: datetime) -> datetime:
    """The end of a step, which cannot lie before it was changed."""
    return ended_at if run.changed_at is None else max(ended_at, run.changed_at)
