"""A drone along its plan: each act is a step and changes time, charge and load."""

from skyway.delivery.plan import Deliver, Fly, PickUp, Recharge, Step, Wait
from skyway.drone.charging import recharge_time_s
from skyway.drone.flight import soc_after_use
from skyway.ids import StationId
from skyway.network.network import Segment
from skyway.planner.situation import Situation
from skyway.planner.weather import STILL_AIR, Air
from skyway.units import TIME_TOLERANCE_S


class FlightLog:
    """Where the drone is, when, and with what charge; `steps` led there."""

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self.here: StationId = situation.problem.start_station_id
        self.now_s = 0.0
        self.soc = situation.problem.drone.soc
        self.steps: list[Step] = []

    def fly(self, segment: Segment, *, load_kg: float, lands: bool, air: Air = STILL_AIR) -> None:
        """Fly a segment; a landing at its end is part of the step."""
        model = self._situation.model
        end_s = self.now_s + self._situation.flight_s(segment, load_kg, air=air)
        energy_j = self._situation.flight_j(segment, load_kg, air=air)
        if lands:
            end_s += model.stop_s
            energy_j += model.stop_j
        soc = soc_after_use(model, self.soc, energy_j=energy_j)
        self.steps.append(
            Fly(
                from_id=segment.from_id,
                to_id=segment.to_id,
                start_s=self.now_s,
                end_s=end_s,
                load_kg=load_kg,
                energy_j=energy_j,
                soc_end=soc,
                time_factor=air.time_factor,
                energy_factor=air.energy_factor,
            )
        )
        self.here, self.now_s, self.soc = segment.to_id, end_s, soc

    def wait(self, *, until_s: float) -> None:
        """Stand until this moment; no step if the moment has come, within the tolerance."""
        if until_s > self.now_s + TIME_TOLERANCE_S:
            self.steps.append(Wait(station_id=self.here, start_s=self.now_s, end_s=until_s))
            self.now_s = until_s

    def stand(self) -> None:
        """Show that the drone has landed, if landing costs something and nothing else is done."""
        model = self._situation.model
        lands_for_free = model.stop_s == 0 and model.stop_j == 0
        if self.steps and isinstance(self.steps[-1], Fly) and not lands_for_free:
            self.steps.append(Wait(station_id=self.here, start_s=self.now_s, end_s=self.now_s))

    def recharge(self, *, pad: int, until_soc: float) -> None:
        """Charge on this pad until this charge."""
        model = self._situation.model_at(self.here)
        end_s = self.now_s + recharge_time_s(model, self.soc, until_soc)
        self.steps.append(
            Recharge(
                station_id=self.here,
                pad=pad,
                start_s=self.now_s,
                end_s=end_s,
                soc_start=self.soc,
                soc_end=until_soc,
                power_w=self._situation.pad_power_w(self.here),
            )
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
        end_s = self.now_s + self._situation.problem.loading_s
        self.steps.append(
            PickUp(
                station_id=self.here,
                package_ids=tuple(
                    package.package_id for package in self._situation.problem.packages
                ),
                start_s=self.now_s,
                end_s=end_s,
            )
        )
        self.now_s = end_s
        if self._situation.packages_for(self.here):
            self._deliver()

    def _deliver(self) -> None:
        end_s = self.now_s + self._situation.problem.dropoff_s
        packages = self._situation.packages_for(self.here)
        self.steps.append(
            Deliver(
                station_id=self.here,
                package_ids=tuple(package.package_id for package in packages),
                start_s=self.now_s,
                end_s=end_s,
            )
        )
        self.now_s = end_s
