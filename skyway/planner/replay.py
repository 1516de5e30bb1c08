"""Replays a plan's steps and notes every rule of the problem that one breaks."""

import math

from skyway.delivery.plan import Deliver, Fly, PickUp, Recharge, Step, Wait
from skyway.drone.charging import fastest_s_per_soc, soc_after_recharge
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.errors import InvalidStateOfCharge
from skyway.ids import PackageId, StationId
from skyway.planner.open_sky import closed_landing, closed_segment, pad_within_reach_j
from skyway.planner.problem import Problem
from skyway.planner.violation import Violation
from skyway.units import CHARGE_TOLERANCE, TIME_TOLERANCE_S

#: Loads closer than this many kilograms are equal: they are sums of the same masses.
_LOAD_TOLERANCE_KG = 1e-9
_MS_PER_S = 1000
_MS_TOLERANCE = TIME_TOLERANCE_S * _MS_PER_S


class Replay:
    """A drone that follows a plan; `violations` are the rules broken so far."""

    def __init__(self, problem: Problem) -> None:
        self.violations: list[Violation] = []
        self._problem = problem
        self._model = problem.drone.model
        self._here: StationId = problem.start_station_id
        self._now_s = 0.0
        self._soc = problem.drone.soc
        self._has_picked_up = False
        self._undelivered: dict[PackageId, StationId] = {
            package.package_id: package.destination for package in problem.packages
        }
        self._number = 0

    def check(self, number: int, step: Step, following: Step | None) -> None:
        """Follow one step; the next one tells whether a flight ends in a landing."""
        self._number = number
        if not abs(step.start_s - self._now_s) <= TIME_TOLERANCE_S:
            self._note("time", f"starts at {step.start_s}, the step before ends at {self._now_s}")
        if not step.end_s >= step.start_s - TIME_TOLERANCE_S:
            self._note("time", f"ends at {step.end_s}, before it starts at {step.start_s}")
        if isinstance(step, Fly):
            self._check_fly(step, lands=not isinstance(following, Fly))
            self._here, self._soc = step.to_id, step.soc_end
        else:
            if step.station_id != self._here:
                self._note("place", f"is at {step.station_id!r}, the drone at {self._here!r}")
            self._check_on_ground(step)
        self._now_s = step.end_s

    def check_end(self) -> None:
        """After the last step: everything delivered, and a pad within reach if asked for."""
        if not self._has_picked_up or self._undelivered:
            missing = ", ".join(self._undelivered) or "all"
            self._note_of_plan("delivery", f"not delivered: {missing}")
        if self._problem.finish == "recharge":
            left_j = (self._soc - self._model.reserve_soc) * self._model.battery_j
            need_j = pad_within_reach_j(self._problem, self._here)
            if left_j < need_j - CHARGE_TOLERANCE * self._model.battery_j:
                self._note_of_plan(
                    "finish", f"{left_j} J left, the nearest pad is {need_j} J from {self._here!r}"
                )

    def _check_on_ground(self, step: PickUp | Wait | Recharge | Deliver) -> None:
        if isinstance(step, PickUp):
            self._check_pick_up(step)
            return
        if isinstance(step, Deliver):
            self._check_deliver(step)
            return
        if self._must_hand_over():
            self._note("hand-over", f"{step.kind} at {self._here!r} before packages change hands")
        if isinstance(step, Recharge):
            self._check_recharge(step)
            self._soc = step.soc_end

    def _must_hand_over(self) -> bool:
        """Whether packages are to be taken on or handed over here before anything else."""
        if not self._has_picked_up:
            return self._here == self._problem.source
        return self._here in self._undelivered.values()

    def _check_pick_up(self, step: PickUp) -> None:
        if self._has_picked_up or step.station_id != self._problem.source:
            self._note("pick-up", "packages are taken on once, at the source")
        if sorted(step.package_ids) != sorted(self._undelivered):
            self._note("pick-up", "not exactly all packages are taken on")
        self._check_duration(step, self._problem.loading_s)
        if self._load_kg() > self._model.max_payload_kg:
            self._note("payload", f"{self._load_kg()} kg exceed {self._model.max_payload_kg} kg")
        self._has_picked_up = True

    def _check_deliver(self, step: Deliver) -> None:
        due = {
            package_id
            for package_id, destination in self._undelivered.items()
            if destination == step.station_id
        }
        if not self._has_picked_up or set(step.package_ids) != due or not due:
            self._note("delivery", f"{step.package_ids} handed over, due are {sorted(due)}")
        self._check_duration(step, self._problem.dropoff_s)
        for package_id in step.package_ids:
            self._undelivered.pop(package_id, None)

    def _check_fly(self, step: Fly, *, lands: bool) -> None:
        if step.from_id != self._here:
            self._note("place", f"starts at {step.from_id!r}, the drone is at {self._here!r}")
        if self._must_hand_over():
            self._note("hand-over", f"leaves {self._here!r} before packages change hands")
        load_kg = self._load_kg() if self._has_picked_up else 0.0
        if not abs(step.load_kg - load_kg) <= _LOAD_TOLERANCE_KG:
            self._note("load", f"{step.load_kg} kg told, {load_kg} kg on board")
        leaving = self._problem.network.stations.get(step.from_id) and (
            self._problem.network.segments_from(step.from_id)
        )
        segment = next((s for s in leaving or () if s.to_id == step.to_id), None)
        if segment is None:
            self._note("segment", f"no segment from {step.from_id!r} to {step.to_id!r}")
            return
        flight = {"length_m": segment.length_m, "load_kg": load_kg}
        flight_s = flight_time_s(self._model, **flight)
        energy_j = flight_energy_j(self._model, **flight)
        self._check_duration(step, flight_s + (self._model.stop_s if lands else 0.0))
        self._check_charge_used(step, energy_j + (self._model.stop_j if lands else 0.0))
        arrival_s = step.start_s + flight_s
        closed = closed_segment(self._problem, step, until_s=arrival_s)
        if closed is None and lands:
            closed = closed_landing(self._problem, step, touch_s=arrival_s)
        if closed is not None:
            self._note("closed", closed)

    def _check_charge_used(self, step: Fly, energy_j: float) -> None:
        allowed_j = CHARGE_TOLERANCE * self._model.battery_j
        if not abs(step.energy_j - energy_j) <= allowed_j:
            self._note("energy", f"{step.energy_j} J told, {energy_j} J used")
        soc_end = self._soc - energy_j / self._model.battery_j
        if not abs(step.soc_end - soc_end) <= CHARGE_TOLERANCE:
            self._note("charge", f"ends at {step.soc_end} told, at {soc_end} true")
        if not soc_end >= self._model.reserve_soc - CHARGE_TOLERANCE:
            self._note("reserve", f"{soc_end} falls below {self._model.reserve_soc}")

    def _check_recharge(self, step: Recharge) -> None:
        if not abs(step.soc_start - self._soc) <= CHARGE_TOLERANCE:
            self._note("charge", f"starts at {step.soc_start} told, at {self._soc} true")
        try:
            soc_end = soc_after_recharge(self._model, self._soc, step.end_s - step.start_s)
        except InvalidStateOfCharge as error:
            self._note("charge", error.detail)
            return
        # The charge is read off a time, so the tolerance of time counts too, at the curve's rate.
        allowed = CHARGE_TOLERANCE + TIME_TOLERANCE_S / fastest_s_per_soc(self._model)
        if not abs(step.soc_end - soc_end) <= allowed:
            self._note("charge", f"ends at {step.soc_end} told, at {soc_end} by the curve")
        is_full = step.soc_end >= self._model.top_soc - CHARGE_TOLERANCE
        if self._problem.recharge_policy == "full" and not is_full:
            self._note("policy", f"ends at {step.soc_end}, not at the top")
        self._check_pad(step)

    def _check_pad(self, step: Recharge) -> None:
        station = self._problem.network.stations.get(step.station_id)
        if station is None or not 0 <= step.pad < station.pads:
            self._note("pad", f"station {step.station_id!r} has no pad {step.pad}")
            return
        start_ms, end_ms = _outward_ms(step.start_s, step.end_s)
        for other in self._problem.pad_reservations:
            if (other.station_id, other.pad) != (step.station_id, step.pad):
                continue
            other_end_s = math.inf if other.end_s is None else other.end_s
            other_start_ms, other_end_ms = _outward_ms(other.start_s, other_end_s)
            if start_ms < other_end_ms and other_start_ms < end_ms:
                self._note(
                    "pad", f"{step.pad} is reserved from {other.start_s} s to {other_end_s} s"
                )

    def _check_duration(self, step: Step, duration_s: float) -> None:
        if not abs(step.end_s - step.start_s - duration_s) <= TIME_TOLERANCE_S:
            self._note("duration", f"{step.end_s - step.start_s} s instead of {duration_s} s")

    def _load_kg(self) -> float:
        return math.fsum(
            package.mass_kg
            for package in self._problem.packages
            if package.package_id in self._undelivered
        )

    def _note(self, rule: str, detail: str) -> None:
        self.violations.append(Violation(self._number, rule, detail))

    def _note_of_plan(self, rule: str, detail: str) -> None:
        self.violations.append(Violation(None, rule, detail))


def _outward_ms(start_s: float, end_s: float) -> tuple[float, float]:
    """Whole milliseconds that hold this time, whatever a float lost in the seventh digit."""
    end_ms = end_s * _MS_PER_S - _MS_TOLERANCE
    return (
        math.floor(start_s * _MS_PER_S + _MS_TOLERANCE),
        end_ms if end_ms == math.inf else math.ceil(end_ms),
    )
