"""A drone along its plan: each act is a step and changes time, charge and load."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from skyway.drone.flight import soc_after_use
from skyway.ids import PackageId, StationId
from skyway.planner.situation import Situation
from skyway.planner.weather import STILL_AIR, Air
from skyway.units import time_tolerance_s

#: The fields of a step in `skyway.delivery.plan`. A search makes many itineraries, and `compose`
#: makes the steps of one of them.
StepFields = dict[str, Any]


class Flight(NamedTuple):
    """The flight over a segment to a station, without a landing: its time, energy and air.

    `row` is the row of the segment, and `not_before_s` the earliest beginning, where they matter.
    """

    to_id: StationId
    flight_s: float
    flight_j: float
    air: Air = STILL_AIR
    row: int = -1
    not_before_s: float = -math.inf


class FlightLog:
    """Where the drone is, when, and with what charge; `steps` led there."""

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._model = situation.model
        self.here: StationId = situation.problem.start_station_id
        self.now_s = 0.0
        self.soc = situation.problem.drone.soc
        self.steps: list[StepFields] = []

    def fly(self, flights: Sequence[Flight], *, load_kg: float) -> None:
        """Fly these segments one after another, and land; the landing is part of the last step."""
        model, last = self._model, len(flights) - 1
        for number, (to_id, flight_s, flight_j, air, _, _) in enumerate(flights):
            start_s, end_s, energy_j = self.now_s, self.now_s + flight_s, flight_j
            if number == last:
                end_s += model.stop_s
                energy_j += model.stop_j
            soc = soc_after_use(model, self.soc, energy_j=energy_j)
            self.steps.append(
                {
                    "kind": "FLY",
                    "from_id": self.here,
                    "to_id": to_id,
                    "start_s": start_s,
                    "end_s": end_s,
                    "load_kg": load_kg,
                    "energy_j": energy_j,
                    "soc_end": soc,
                    "time_factor": air.time_factor,
                    "energy_factor": air.energy_factor,
                }
            )
            self.here, self.now_s, self.soc = to_id, end_s, soc

    def wait(self, *, until_s: float) -> None:
        """Stand until this moment; no step if the moment has come, within the tolerance."""
        if until_s > self.now_s and until_s > self.now_s + time_tolerance_s(until_s) / 2:
            self._stand_until(until_s)

    def stand(self) -> None:
        """Show that the drone has landed, if landing costs something and nothing else is done."""
        lands_for_free = self._model.stop_s == 0 and self._model.stop_j == 0
        if self.steps and self.steps[-1]["kind"] == "FLY" and not lands_for_free:
            self._stand_until(self.now_s)

    def _stand_until(self, end_s: float) -> None:
        step = {"kind": "WAIT", "station_id": self.here, "start_s": self.now_s, "end_s": end_s}
        self.steps.append(step)
        self.now_s = end_s

    def recharge(
        self, *, pad: int, power_w: float | None, until_soc: float, duration_s: float
    ) -> None:
        """Charge on this pad of this power until this charge, which takes so long."""
        end_s = self.now_s + duration_s
        self.steps.append(
            {
                "kind": "RECHARGE",
                "station_id": self.here,
                "pad": pad,
                "start_s": self.now_s,
                "end_s": end_s,
                "soc_start": self.soc,
                "soc_end": until_soc,
                "power_w": power_w,
            }
        )
        self.now_s, self.soc = end_s, until_soc

    def hand_over(self) -> None:
        """Take the packages on board at the source, or hand over the packages for this station."""
        if self.here == self._situation.problem.source:
            self.pick_up()
        else:
            self._deliver()

    def pick_up(self) -> None:
        """Take all packages on board; hand over those for the source right after."""
        problem = self._situation.problem
        package_ids = [package.package_id for package in problem.packages]
        self._transfer("PICK_UP", package_ids, duration_s=problem.loading.takes_s)
        if self._situation.packages_for(self.here):
            self._deliver()

    def _deliver(self) -> None:
        package_ids = [one.package_id for one in self._situation.packages_for(self.here)]
        self._transfer("DELIVER", package_ids, duration_s=self._situation.problem.dropoff_s)

    def _transfer(self, kind: str, package_ids: list[PackageId], *, duration_s: float) -> None:
        end_s = self.now_s + duration_s
        self.steps.append(
            {
                "kind": kind,
                "station_id": self.here,
                "package_ids": tuple(package_ids),
                "start_s": self.now_s,
                "end_s": end_s,
            }
        )
        self.now_s = end_s
