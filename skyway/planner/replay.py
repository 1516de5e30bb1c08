"""Replays a plan's steps and notes every rule of the problem that a step breaks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from skyway.delivery.plan import Deliver, Fly, PickUp, Recharge, Step, Wait
from skyway.drone.cargo import misfit
from skyway.drone.charging import fastest_s_per_soc, model_on_pad, soc_after_recharge
from skyway.drone.flight import flight_power_w, speed_mps
from skyway.errors import InvalidStateOfCharge
from skyway.ids import PackageId, StationId
from skyway.network.pad_connectors import PAD_CONNECTORS
from skyway.planner.obstacles import (
    STILL,
    MovingAir,
    OpenSky,
    does_fit,
    is_pad_within_reach,
)
from skyway.planner.plan_columns import lengths_flown, pad_clashes
from skyway.planner.problem import Problem
from skyway.units import CHARGE_TOLERANCE, LOAD_TOLERANCE_KG, TIME_TOLERANCE_S, time_tolerance_s

if TYPE_CHECKING:
    from skyway.planner.pad_book import PadBook

#: Stated factors of the weather differ from the weather by rounding only.
_FACTOR_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True)
class Violation:
    """What is wrong; `step` counts the plan's steps from 0, None for the plan as a whole."""

    step: int | None
    rule: str
    detail: str

    def __str__(self) -> str:
        where = "plan" if self.step is None else f"steps.{self.step}"
        return f"{where}: {self.rule}: {self.detail}"


class Replay:
    """A drone that follows a plan; `violations` are the rules broken so far."""

    def __init__(
        self, problem: Problem, steps: Sequence[Step], *, booked: "PadBook | None"
    ) -> None:
        self.violations: list[Violation] = []
        self._problem = problem
        self._model = problem.drone.model
        self._stop = self._model.stop_s, self._model.stop_j
        self._battery_j, self._reserve_soc = self._model.battery_j, self._model.reserve_soc
        self._fastest_s_per_soc = fastest_s_per_soc(self._model)
        recharges_fully = problem.recharge_policy == "full"
        #: The least charge with which a recharge may end.
        self._least_soc = self._model.top_soc - CHARGE_TOLERANCE if recharges_fully else -math.inf
        #: By the number of the step: the length of its segment, and a reservation that it overlaps.
        self._length_m = lengths_flown(problem.network, steps)
        self._clashes = pad_clashes(problem, steps, booked=booked)
        self._limited_w = problem.network.pad_powers.limited_w
        self._sky = OpenSky(problem, steps)
        self._air = MovingAir(problem)
        self._has_weather = problem.weather is not None
        self._may_be_closed = self._has_weather or self._sky.has_obstacles
        self._here: StationId = problem.start_station_id
        self._now_s = self._lasts_s = 0.0
        #: The tolerance for moments near the end of the current step.
        self._allowed_s = time_tolerance_s(0.0)
        self._soc = problem.drone.soc
        self._has_picked_up = False
        self._may_pass = problem.may_pass
        self._undelivered: dict[PackageId, StationId] = {
            package.package_id: package.destination for package in problem.packages
        }
        self._number = 0
        self._follow_hand_over()

    def check(self, number: int, step: Step, following: Step | None) -> None:
        """Follow one step; the next step shows whether a flight ends in a landing."""
        self._number = number
        start_s, end_s = step.start_s, step.end_s
        if self._has_picked_up and not self._undelivered:
            self._note("end", f"{step.kind} after the last delivery")
        if not abs(start_s - self._now_s) <= self._allowed_s:
            self._note("time", f"starts at {start_s}, the step before ends at {self._now_s}")
        if not end_s >= start_s - TIME_TOLERANCE_S:
            self._note("time", f"ends at {end_s}, before it starts at {start_s}")
        self._now_s, self._lasts_s = end_s, end_s - start_s
        self._allowed_s = time_tolerance_s(end_s)
        if step.kind == "FLY":
            self._check_fly(step, lands=following is None or following.kind != "FLY")
            self._here, self._soc = step.to_id, step.soc_end
        else:
            if step.station_id != self._here:
                self._note("place", f"is at {step.station_id!r}, the drone at {self._here!r}")
            self._check_on_ground(step)

    def check_end(self) -> None:
        """After the last step: all is delivered, and a pad is in reach if the finish needs it."""
        if not self._has_picked_up or self._undelivered:
            missing = ", ".join(self._undelivered) or "all"
            self._note_of_plan("delivery", f"not delivered: {missing}")
        if self._problem.finish == "recharge" and self._here in self._problem.network.stations:
            energy_j = (self._soc - self._reserve_soc + CHARGE_TOLERANCE) * self._battery_j
            if not is_pad_within_reach(self._problem, self._here, energy_j=energy_j):
                self._note_of_plan("finish", f"{energy_j} J left, no pad so near to {self._here!r}")

    def _check_on_ground(self, step: PickUp | Wait | Recharge | Deliver) -> None:
        if step.kind == "PICK_UP":
            self._check_pick_up(step)
            return
        if step.kind == "DELIVER":
            self._check_deliver(step)
            return
        if self._here in self._hand_overs:
            self._note("hand-over", f"{step.kind} at {self._here!r} before packages change hands")
        if step.kind == "RECHARGE":
            self._check_recharge(step)
            self._check_pad(step)
            self._soc = step.soc_end

    def _check_pick_up(self, step: PickUp) -> None:
        if self._has_picked_up or step.station_id != self._problem.source:
            self._note("pickup", "packages are picked up once, at the source")
        if sorted(step.package_ids) != sorted(self._undelivered):
            self._note("pickup", "not exactly all packages are picked up")
        problem = self._problem
        if problem.are_on_board:
            self._check_duration(0.0)
        else:
            self._check_duration(problem.loading_s)
            self._check_window(step, problem.pickup_not_before_s, problem.pickup_latest_s)
            self._check_hours(step)
        limit_kg = self._model.max_payload_kg
        if self._load_kg > limit_kg + LOAD_TOLERANCE_KG:
            self._note("payload", f"{self._load_kg} kg exceed {limit_kg} kg")
        if (found := misfit(self._model, problem.packages)) is not None:
            self._note("cargo", found.detail)
        self._has_picked_up = True
        self._follow_hand_over()

    def _check_deliver(self, step: Deliver) -> None:
        due = sorted(
            package_id
            for package_id, destination in self._undelivered.items()
            if destination == step.station_id
        )
        if not self._has_picked_up or sorted(step.package_ids) != due or not due:
            self._note("delivery", f"{step.package_ids} handed over, due are {due}")
        self._check_duration(self._problem.dropoff_s)
        for package in self._problem.packages:
            if package.package_id in step.package_ids:
                self._check_window(step, package.not_before_s, package.latest_s)
        self._check_hours(step)
        for package_id in step.package_ids:
            self._undelivered.pop(package_id, None)
        self._follow_hand_over()

    def _check_hours(self, step: PickUp | Deliver) -> None:
        closed = self._sky.closed_by_hours(step.station_id, step.start_s, step.end_s)
        if closed is not None:
            self._note("closed", f"{step.kind}: {closed}")

    def _check_window(
        self, step: PickUp | Deliver, not_before_s: float | None, latest_s: float | None
    ) -> None:
        if not_before_s is not None and not step.start_s >= not_before_s - self._allowed_s:
            self._note("window", f"{step.kind} starts at {step.start_s}, before {not_before_s}")
        if latest_s is not None and not step.end_s <= latest_s + self._allowed_s:
            self._note("window", f"{step.kind} ends at {step.end_s}, after {latest_s}")

    def _check_fly(self, step: Fly, *, lands: bool) -> None:
        if step.from_id != self._here:
            self._note("place", f"starts at {step.from_id!r}, the drone is at {self._here!r}")
        if self._here in self._hand_overs:
            self._note("hand-over", f"leaves {self._here!r} before packages change hands")
        if not abs(step.load_kg - self._on_board_kg) <= LOAD_TOLERANCE_KG:
            self._note("load", f"{step.load_kg} kg stated, {self._on_board_kg} kg on board")
        length_m = self._length_m.get(self._number)
        if length_m is None:
            self._note("segment", f"no segment from {step.from_id!r} to {step.to_id!r}")
            return
        stop_s, stop_j = self._stop if lands else (0.0, 0.0)
        flight_s = length_m / self._speed_mps
        energy_j, air = self._power_w * flight_s, STILL
        if self._has_weather:
            met = self._air.flight(step, flight_s, energy_j, stop_s=stop_s, stop_j=stop_j)
            if met is None:
                self._note("closed", "the weather closes the segment when the flight begins")
                return
            flight_s, energy_j, air = met
        self._check_duration(flight_s + stop_s)
        if not (
            abs(step.time_factor - air.longer) <= _FACTOR_TOLERANCE
            and abs(step.energy_factor - air.harder) <= _FACTOR_TOLERANCE
        ):
            stated = f"{step.time_factor} and {step.energy_factor}"
            self._note("air", f"factors {stated} stated, {air.longer} and {air.harder} met")
        self._check_charge_used(step, energy_j + stop_j)
        if self._may_be_closed:
            self._check_open(step, arrival_s=step.start_s + flight_s, lands=lands)

    def _check_open(self, step: Fly, *, arrival_s: float, lands: bool) -> None:
        closed = self._sky.closed_segment(step, until_s=arrival_s)
        if closed is None:
            closed = self._air.closed_segment(step, until_s=arrival_s)
        if closed is None and lands:
            closed = self._sky.closed_landing(step, touch_s=arrival_s)
        if closed is not None:
            self._note("closed", closed)

    def _check_charge_used(self, step: Fly, energy_j: float) -> None:
        battery_j = self._battery_j
        if not abs(step.energy_j - energy_j) <= CHARGE_TOLERANCE * battery_j:
            self._note("energy", f"{step.energy_j} J stated, {energy_j} J used")
        soc_end = self._soc - energy_j / battery_j
        if not abs(step.soc_end - soc_end) <= CHARGE_TOLERANCE:
            self._note("charge", f"ends at {step.soc_end} stated, at {soc_end} true")
        if not soc_end >= self._reserve_soc - CHARGE_TOLERANCE:
            self._note("reserve", f"{soc_end} falls below {self._reserve_soc}")

    def _check_recharge(self, step: Recharge) -> None:
        if not abs(step.soc_start - self._soc) <= CHARGE_TOLERANCE:
            self._note("charge", f"starts at {step.soc_start} stated, at {self._soc} true")
        power_w = self._limited_w.get(step.station_id)
        if step.power_w != power_w:
            self._note("power", f"{step.power_w} W stated, the pads give {power_w} W")
        try:
            model = model_on_pad(self._model, power_w)
            soc_end = soc_after_recharge(model, self._soc, self._lasts_s)
        except InvalidStateOfCharge as error:
            self._note("charge", error.detail)
            return
        # The charge follows from a time, so the tolerance of times counts too, at the curve's rate.
        by_time = self._allowed_s / self._fastest_s_per_soc
        if not abs(step.soc_end - soc_end) <= CHARGE_TOLERANCE + by_time:
            self._note("charge", f"ends at {step.soc_end} stated, at {soc_end} by the curve")
        if not step.soc_end >= self._least_soc:
            self._note("policy", f"ends at {step.soc_end}, not at the top")

    def _check_pad(self, step: Recharge) -> None:
        network = self._problem.network
        row = network.row_of.get(step.station_id)
        if row is None or not 0 <= step.pad < network.columns.pads.item(row):
            self._note("pad", f"station {step.station_id!r} has no pad {step.pad}")
            return
        if self._model.connector is not None and not does_fit(
            self._model, station := network.stations[step.station_id]
        ):
            have = ", ".join(station.properties[PAD_CONNECTORS])
            self._note("connector", f"{self._model.connector} does not fit pads with {have}")
        clash = self._clashes.get(self._number)
        if clash is not None:
            self._note("pad", f"{step.pad} is reserved from {clash[0]} ms to {clash[1]} ms")

    def _check_duration(self, duration_s: float) -> None:
        if not abs(self._lasts_s - duration_s) <= self._allowed_s:
            self._note("duration", f"{self._lasts_s} s instead of {duration_s} s")

    def _follow_hand_over(self) -> None:
        """Note the load, its flight, and where packages must change hands before another step."""
        due = set(self._undelivered.values())
        source, model = self._problem.source, self._model
        if self._may_pass:
            # Packages for the source are handed over right after loading, windows or not.
            self._hand_overs = due & {source} if self._has_picked_up else set()
        else:
            self._hand_overs = due if self._has_picked_up else {source}
        self._load_kg = math.fsum(
            package.mass_kg
            for package in self._problem.packages
            if package.package_id in self._undelivered
        )
        self._on_board_kg = self._load_kg if self._has_picked_up else 0.0
        self._speed_mps = speed_mps(model, self._on_board_kg)
        self._power_w = flight_power_w(model, self._on_board_kg)

    def _note(self, rule: str, detail: str) -> None:
        self.violations.append(Violation(self._number, rule, detail))

    def _note_of_plan(self, rule: str, detail: str) -> None:
        self.violations.append(Violation(None, rule, detail))
