"""When and how a simulated step ends, by the planner's arithmetic and the disturbances."""

import math
from datetime import UTC, datetime, timedelta
from typing import Final

from skyway.contracts.flight_step import (
    DeliverStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.drone.charging import (
    cold_charging_factor,
    model_on_pad,
    recharge_time_s,
    soc_after_recharge,
)
from skyway.drone.model import DroneModel
from skyway.ids import DroneId
from skyway_drone_agent.simulated.disturbances import UNDISTURBED, Disturbances, happens
from skyway_drone_agent.simulated.flight import SimulatedFlight, flight_of
from skyway_drone_agent.vehicle import Outcome, Sample, StepRun, wait_ends_at


def pad_free_at(step: RechargeStep, arrived_at: datetime, *, disturbed: Disturbances) -> datetime:
    """When the pad of this recharge is first free after the arrival."""
    free_at = arrived_at
    while (later := _taken_until(step, free_at, disturbed=disturbed)) > free_at:
        free_at = later
    return free_at


def _taken_until(step: RechargeStep, at: datetime, *, disturbed: Disturbances) -> datetime:
    """When the pad becomes free; the moment itself if the pad is free."""
    pads, until_at = disturbed.pads, at
    for taken in pads.taken:
        is_this = taken.station_id == step.station_id and taken.pad in (None, step.pad)
        if is_this and taken.from_at <= at < taken.until_at:
            until_at = max(until_at, taken.until_at)
    if pads.taken_share > 0.0:
        span = math.floor(at.timestamp() / pads.taken_s)
        if happens(pads.taken_share, disturbed.seed, "pad", step.station_id, step.pad, span):
            ended = datetime.fromtimestamp(0, UTC) + timedelta(seconds=(span + 1) * pads.taken_s)
            until_at = max(until_at, ended)
    return until_at


#: Planned moments and pad reservations are rounded to whole milliseconds: a recharge that misses
#: less than this is complete.
_RESERVATION_GRAIN: Final = timedelta(milliseconds=2)

#: The drone id for chance where no drone is named.
_NO_DRONE: Final = DroneId("")


class Physics:
    """The physics of a drone with its disturbances; results depend only on (run, moment)."""

    def __init__(
        self,
        model: DroneModel,
        disturbances: Disturbances = UNDISTURBED,
        *,
        drone_id: DroneId = _NO_DRONE,
    ) -> None:
        self.model = model
        self.disturbances = disturbances
        self.drone_id = drone_id
        battery = disturbances.battery
        self.is_worn = happens(battery.worn_share, disturbances.seed, "worn", drone_id)
        #: The real capacity of the battery; a worn battery has less than the model says.
        self.battery_j = model.battery_j * (battery.capacity if self.is_worn else 1.0)
        self._slower = disturbances.charge_time_factor * cold_charging_factor(battery.temperature_c)
        self._last: tuple[StepRun, SimulatedFlight] | None = None

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
        if isinstance(run.step, FlyStep):
            return self._in_flight(run, run.step, at=at)
        soc = run.soc
        if isinstance(run.step, RechargeStep) and soc < run.step.until_soc:
            charged_s = (at - self.pad_free_at(run, run.step)).total_seconds()
            charged_soc = self._charged(run.step, soc, max(0.0, charged_s))
            soc = min(charged_soc, run.step.until_soc)
        return Sample(run.position, soc, power_w=0.0, speed_mps=0.0)

    def flight(self, run: StepRun, step: FlyStep) -> SimulatedFlight:
        """The flight of a run; the last one is cached, because it is used many times."""
        if self._last is not None and _is_same_flight(self._last[0], run):
            return self._last[1]
        flight = flight_of(
            step,
            run.started_at,
            load_kg=run.load_kg,
            model=self.model,
            disturbed=self.disturbances,
            drone_id=self.drone_id,
        )
        self._last = (run, flight)
        return flight

    def pad_free_at(self, run: StepRun, step: RechargeStep) -> datetime:
        """When this recharge can begin."""
        return pad_free_at(step, run.started_at, disturbed=self.disturbances)

    def landed(self, run: StepRun, at: datetime) -> Outcome:
        """The end of a flight that lands from where it is at this moment."""
        flown_j = (run.soc - self.sample(run, at).soc) * self.battery_j
        energy_j = flown_j + self.model.stop_j
        landed_at = at + timedelta(seconds=self.model.stop_s)
        return Outcome(landed_at, self._soc_after(run.soc, energy_j), energy_j)

    def _soc_after(self, soc: float, energy_j: float) -> float:
        return max(0.0, soc - energy_j / self.battery_j)

    def _charge_factor(self) -> float:
        """Charge time by the model's: a worn battery holds less and is full earlier."""
        return self._slower * self.battery_j / self.model.battery_j

    def _model_on_pad(self, step: RechargeStep) -> DroneModel:
        """The model with the charge curve of this pad, before the charge factor."""
        if step.power_w is None:
            return self.model
        # The factor slows the drone's own charger. It does not slow the pad.
        return model_on_pad(self.model, step.power_w * self._slower)

    def _charged(self, step: RechargeStep, soc: float, duration_s: float) -> float:
        on_curve = max(soc, self.model.charge_curve[0].soc)
        charging = self._model_on_pad(step)
        return soc_after_recharge(charging, on_curve, duration_s / self._charge_factor())

    def _flown(self, run: StepRun, step: FlyStep) -> Outcome:
        flight = self.flight(run, step)
        over_at, energy_j = flight.over_at, flight.used_j(flight.way_s)
        if step.lands:
            ended_at = _no_earlier(run, over_at + timedelta(seconds=self.model.stop_s))
            energy_j += self.model.stop_j
        else:
            ended_at = _no_earlier(run, over_at)
            if ended_at > over_at:
                # An instruction let it fly on during the landing: that energy is lost.
                energy_j += self._landing_j((ended_at - over_at).total_seconds())
        return Outcome(ended_at, self._soc_after(run.soc, energy_j), energy_j)

    def _landing_j(self, landing_s: float) -> float:
        return self.model.stop_j * min(1.0, landing_s / max(self.model.stop_s, 1.0))

    def _recharged(self, run: StepRun, step: RechargeStep) -> Outcome:
        until_soc = min(step.until_soc, self.model.top_soc)
        if run.soc >= until_soc:
            return Outcome(run.started_at, run.soc, energy_j=0.0)
        soc = max(run.soc, self.model.charge_curve[0].soc)
        charge_s = recharge_time_s(self._model_on_pad(step), soc, until_soc)
        charge_s *= self._charge_factor()
        begun_at = self.pad_free_at(run, step)
        full_at = begun_at + timedelta(seconds=charge_s)
        if full_at <= step.not_after_at + _RESERVATION_GRAIN:
            return Outcome(full_at, until_soc, energy_j=0.0)
        ended_at = max(run.started_at, step.not_after_at)
        if run.started_at < ended_at <= begun_at:
            # The pad was occupied for the whole reservation, so the drone could not charge.
            return Outcome(ended_at, run.soc, energy_j=0.0, code="PAD_OCCUPIED", has_failed=True)
        charged_s = max(0.0, (ended_at - begun_at).total_seconds())
        short_soc = self._charged(step, soc, charged_s) if charged_s else run.soc
        return Outcome(ended_at, short_soc, energy_j=0.0, code="SHORT_CHARGE")

    def _delivered(self, run: StepRun, step: DeliverStep) -> Outcome:
        dropoff = timedelta(seconds=step.dropoff_s)
        given_up_at = wait_ends_at(run)
        if given_up_at is not None:
            handed_ids = step.ready_ids
            return Outcome(
                given_up_at + dropoff if handed_ids else given_up_at,
                run.soc,
                energy_j=0.0,
                code="RECIPIENT_ABSENT",
                has_failed=True,
                handed_ids=handed_ids,
            )
        # A recipient who has given a proof is there.
        if run.changed_at is not None or self._is_recipient_there(step):
            return Outcome(_no_earlier(run, run.started_at) + dropoff, run.soc, energy_j=0.0)
        return Outcome(
            run.started_at + timedelta(seconds=step.recipient_wait_s),
            run.soc,
            energy_j=0.0,
            code="RECIPIENT_ABSENT",
            has_failed=True,
        )

    def _is_recipient_there(self, step: DeliverStep) -> bool:
        disturbed = self.disturbances
        if step.station_id in disturbed.absent_station_ids:
            return False
        which = (step.station_id, *step.package_ids)
        return not happens(disturbed.absent_share, disturbed.seed, "absent", *which)

    def _in_flight(self, run: StepRun, step: FlyStep, *, at: datetime) -> Sample:
        flight = self.flight(run, step)
        elapsed_s = max(0.0, (at - run.started_at).total_seconds())
        energy_j, power_w = flight.used_j(elapsed_s), flight.power_w(elapsed_s)
        landing_s = elapsed_s - flight.way_s
        if step.lands and landing_s >= 0.0:
            energy_j += self._landing_j(landing_s)
            power_w = self.model.stop_j / max(self.model.stop_s, 1.0)
        return Sample(
            position=flight.position(elapsed_s),
            soc=self._soc_after(run.soc, energy_j),
            power_w=power_w,
            speed_mps=flight.speed_mps(elapsed_s),
        )


def _is_same_flight(cached: StepRun, run: StepRun) -> bool:
    return (
        cached.started_at == run.started_at
        and cached.load_kg == run.load_kg
        and (cached.step is run.step or cached.step == run.step)
    )


def _no_earlier(run: StepRun, ended_at: datetime) -> datetime:
    """The end of a step, at the earliest when an instruction last changed it."""
    return ended_at if run.changed_at is None else max(ended_at, run.changed_at)
