"""How the battery ages: its capacity, the voltage spread of its cells, and how fast it charges."""

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from skyway.contracts.flight_step import RechargeStep
from skyway.drone.charging import fastest_w, model_in_cold, recharge_time_s
from skyway.drone.model import DroneModel
from skyway_drone_agent.vehicle import BatteryPack, Reading, StepRun

#: The battery is at rest below this current.
_REST_A: Final = 1.0

#: Share of the capacity that may be used while the battery still counts as at rest.
_REST_USE: Final = 0.005

#: Error of a voltage at rest.
_VOLTAGE_ERROR_V: Final = 0.1

#: The charge at rest is precise when its standard deviation is at most this.
_PRECISE: Final = 0.03

#: Two charges closer than this say little about the capacity.
_LEAST_BETWEEN: Final = 0.25

#: Error of a new drone's capacity, and the least error, so that the estimate follows ageing.
_FIRST_ERROR, _LEAST_ERROR = 0.1, 0.02

#: Error of the capacity in the journal, which may be old.
_KEPT_ERROR: Final = 0.05

#: The lowest health of a battery.
_WORST: Final = 0.3

#: Seconds over which the cells' difference is smoothed.
_SPREAD_OVER_S: Final = 20.0


@dataclass(slots=True)
class _Rest:
    """A time at rest: the mean of its voltages, and the counter of used energy."""

    consumed_j: float
    open_v: float
    readings: int = 1


class BatteryHealth:
    """Capacity of one battery as a share of the model's, and the spread of its cells.

    `error` is the standard deviation of that share.
    """

    __slots__ = (
        "_pack",
        "_rated_j",
        "_reference",
        "_rest",
        "_seen_at",
        "cell_spread_v",
        "error",
        "state_of_health",
    )

    def __init__(self, pack: BatteryPack, *, rated_j: float, state_of_health: float = 1.0) -> None:
        self.state_of_health = max(_WORST, state_of_health)
        self.cell_spread_v = 0.0
        self._pack = pack
        self._rated_j = rated_j
        self.error = _FIRST_ERROR if state_of_health == 1.0 else _KEPT_ERROR
        self._rest: _Rest | None = None
        self._reference: _Rest | None = None
        self._seen_at: datetime | None = None

    def update(self, reading: Reading, *, resistance_ohm: float) -> None:
        """Learn from this reading."""
        self._smooth_spread(reading)
        rest = self._rest
        if rest is not None and abs(reading.consumed_j - rest.consumed_j) > self._rest_use_j:
            self._compare(rest)
            rest = self._rest = None
        if abs(reading.current_a) >= _REST_A:
            if rest is not None:
                self._compare(rest)
                self._rest = None
            return
        open_v = reading.voltage_v + reading.current_a * resistance_ohm
        if rest is None:
            self._rest = _Rest(reading.consumed_j, open_v)
        else:
            rest.readings += 1
            rest.open_v += (open_v - rest.open_v) / rest.readings

    @property
    def _rest_use_j(self) -> float:
        return _REST_USE * self._rated_j

    def _compare(self, rest: _Rest) -> None:
        """Compare the energy counted between two rests with the charges that they showed."""
        if self._error_of(rest) > _PRECISE:
            return
        reference = self._reference
        if reference is None:
            self._reference = rest
            return
        between = self._soc_of(reference) - self._soc_of(rest)
        if abs(between) < _LEAST_BETWEEN:
            return
        self._reference = rest
        seen = (rest.consumed_j - reference.consumed_j) / (between * self._rated_j)
        if not 0.0 < seen < 2.0:
            # The counter was reset in between.
            return
        error = math.hypot(self._error_of(reference), self._error_of(rest)) * seen / abs(between)
        variance = self.error * self.error
        gain = variance / (variance + error * error)
        health = self.state_of_health + gain * (seen - self.state_of_health)
        self.state_of_health = min(1.0, max(_WORST, health))
        self.error = max(_LEAST_ERROR, (variance * (1.0 - gain)) ** 0.5)

    def _soc_of(self, rest: _Rest) -> float:
        return self._pack.soc_at_rest(rest.open_v)

    def _error_of(self, rest: _Rest) -> float:
        return _VOLTAGE_ERROR_V / self._pack.volts_per_soc(self._soc_of(rest))

    def _smooth_spread(self, reading: Reading) -> None:
        spread_v = max(0.0, reading.cell_high_v - reading.cell_low_v)
        share = 1.0
        if self._seen_at is not None:
            seconds = (reading.at - self._seen_at).total_seconds()
            share = 1.0 - math.exp(-max(0.0, seconds) / _SPREAD_OVER_S)
        self._seen_at = reading.at
        self.cell_spread_v += share * (spread_v - self.cell_spread_v)


#: Seconds on a pad before a recharge is measured: the charge after a flight is estimated under
#: load, and the voltage at rest corrects it first.
_SETTLES_WITHIN_S: Final = 180.0

#: A recharge that gives less charge is not measured: the error of the estimate would count much.
_LEAST_GAIN: Final = 0.1

#: Limits of the factor; beyond them something else is wrong.
_SLOWEST, _FASTEST = 0.05, 10.0


class ChargeRate:
    """How fast the last recharge raised the charge, divided by the model's charge curve in cold.

    `factor` is of the last recharge that was long enough, and None before one. Time beside an
    occupied pad does not count. Nor do recharges on a pad that gives less power than the model can
    charge with: they do not show what the drone's own charger can do.
    """

    __slots__ = ("_arrived_at", "_begun", "_model", "factor")

    def __init__(self, model: DroneModel) -> None:
        self.factor: float | None = None
        self._model = model
        self._arrived_at: datetime | None = None
        self._begun: tuple[datetime, float] | None = None

    def update(self, reading: Reading, run: StepRun | None, *, soc: float) -> None:
        """Learn from this reading and its estimated charge."""
        if run is None or not self._shows_charger(run) or not reading.pad_is_free:
            self._arrived_at = self._begun = None
            return
        if self._arrived_at is None:
            self._arrived_at = reading.at
        soc = min(max(soc, self._model.charge_curve[0].soc), self._model.top_soc)
        if self._begun is None:
            if (reading.at - self._arrived_at).total_seconds() >= _SETTLES_WITHIN_S:
                self._begun = (reading.at, soc)
            return
        begun_at, begun_soc = self._begun
        seconds = (reading.at - begun_at).total_seconds()
        if seconds > 0.0 and soc - begun_soc >= _LEAST_GAIN:
            # Plans count the cold already: it is no property of the drone.
            by_model = model_in_cold(self._model, reading.temperature_c)
            factor = recharge_time_s(by_model, begun_soc, soc) / seconds
            self.factor = min(_FASTEST, max(_SLOWEST, factor))

    def _shows_charger(self, run: StepRun) -> bool:
        """Whether the drone is on a pad that does not slow its charger."""
        step = run.step
        if not isinstance(step, RechargeStep):
            return False
        return step.power_w is None or step.power_w >= fastest_w(self._model)
