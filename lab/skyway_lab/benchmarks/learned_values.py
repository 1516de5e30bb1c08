"""What plans gain from the learned values of drones: promised against flown, in virtual time.

`python -m skyway_lab learned_values [--scenario cold] [--drones 12] [--missions 6] [--seed 1]`
flies the missions of each drone one after another through the bundled network: planned by the
drone's model, and with what its flights have shown. Nothing is planned again on the way, and a
drone stays on its pad until it has the planned charge: so it is late by what the plan did not know.
The figures do not depend on the machine.
"""

import argparse
import random
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final

from skyway_composition.missions.mission.from_trip import StepTerms, flight_steps
from skyway_composition.planning.problem_for import with_margin
from skyway_drone_agent.analysis.analysis import Analysis, Assessment
from skyway_drone_agent.analysis.leg import leg_of
from skyway_drone_agent.flying.step_checks import shortfall_of
from skyway_drone_agent.messages.state import health_of
from skyway_drone_agent.simulated.disturbances import Disturbances, changed, read_scenario
from skyway_drone_agent.vehicle import LoadedFlights
from skyway_lab.benchmarks.telemetry_thinning.flown import START, Flown, Moment
from skyway_provider_registry.presence.learning import Learned

from skyway.contracts.flight_step import DeliverStep, FlightStep, FlyStep, RechargeStep, WaitStep
from skyway.drone.learned_values import AS_MODELLED, model_as_learned
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import distance_m
from skyway.ids import DroneId, PackageId, StationId
from skyway.network.bundled import texas_corridor
from skyway.network.network import Network
from skyway.planner.compose import compose
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem
from skyway.scheduling.trip import PlacedStep
from skyway.units import moment_to_ms

MODEL: Final = DJI_MATRICE_300_RTK
PACKAGE: Final = PackageId("p")

#: The margin of networks, seconds of a hand-over, and between two looks of the drone.
_MARGIN, _HAND_OVER_S, _LOOKS_EVERY_S = 0.15, 60.0, 20.0

#: How far apart pickup and destination are, metres, and what a package weighs, kilograms.
_APART_M, _MASS_KG = (15_000.0, 60_000.0), (0.3, 2.5)

#: The charge at the first mission, and to which a drone charges after each.
_READY_SOC: Final = 0.9

#: The first missions of each drone teach; the others are reported.
_TEACHING: Final = 2

#: A session on a pad is too short when the drone needs so much longer.
_TOO_SHORT: Final = timedelta(seconds=30)


@dataclass(slots=True)
class FlownMission:
    """What became of a mission: minutes late, sessions too short, the least charge at a landing."""

    late_min: float = 0.0
    short_sessions: int = 0
    least_soc: float = 1.0
    is_refused: bool = False


@dataclass(slots=True)
class FlyingDrone:
    """One drone with its analysis on board, and what the registry has learned about it."""

    drone_id: DroneId
    day: Disturbances
    network: Network
    here: StationId
    learns: bool
    soc: float = _READY_SOC
    now: datetime = START
    learned: Learned = field(default_factory=Learned)
    analysis: Analysis = field(default_factory=lambda: Analysis(MODEL))

    def deliver(self, pickup: StationId, destination: StationId, *, mass_kg: float) -> FlownMission:
        """Fly one mission, charge where it ends, and learn from both."""
        planned = self._planned(pickup, destination, mass_kg=mass_kg)
        promised_at = planned[-1].planned_end_at
        steps = [*planned, *_charging(destination, promised_at, first_step=len(planned) + 1)]
        flown = Flown(
            MODEL,
            tuple(map(_open_ended, steps)),
            self.day,
            drone_id=self.drone_id,
            soc=self.soc,
            begins_at=self.now,
        )
        found, last, mission = None, None, FlownMission()
        for moment in flown.moments(every_s=_LOOKS_EVERY_S):
            seen = self.analysis.assess(moment.reading, moment.logbook)
            if found is None:
                mission.is_refused = _refuses(planned, seen)
            if last is not None and last.run.step.step_id != moment.run.step.step_id:
                self._end(
                    last, seen, flown=flown, steps=steps, promised_at=promised_at, mission=mission
                )
            found, last = seen, moment
        self.here, self.now = destination, last.reading.at if last else self.now
        self.soc = last.true_soc if last else self.soc
        return mission

    def _planned(
        self, pickup: StationId, destination: StationId, *, mass_kg: float
    ) -> tuple[FlightStep, ...]:
        known = self.learned.planned if self.learns else AS_MODELLED
        model = with_margin(model_as_learned(MODEL, known), _MARGIN)
        package = PackageToDeliver(package_id=PACKAGE, mass_kg=mass_kg, destination=destination)
        problem = Problem(
            network=self.network,
            drone=DroneAtStart(model=model, soc=self.soc, station_id=self.here),
            source=pickup,
            packages=(package,),
            loading_s=_HAND_OVER_S,
            dropoff_s=_HAND_OVER_S,
        )
        placed = [PlacedStep(moment_to_ms(self.now), step) for step in compose(problem).steps]
        terms = StepTerms({PACKAGE: mass_kg})
        return flight_steps(self.network, placed, terms=terms, first_step=1)

    def _end(
        self,
        last: Moment,
        seen: Assessment,
        *,
        flown: Flown,
        steps: Sequence[FlightStep],
        promised_at: datetime,
        mission: FlownMission,
    ) -> None:
        """Learn from the step that has ended, and note what it did to the mission."""
        step, outcome = last.run.step, flown.physics.outcome_of(last.run)
        match step:
            case FlyStep(lands=True):
                self.learned = self.learned.after_flight(health_of(seen))
                mission.least_soc = min(mission.least_soc, outcome.soc)
            case DeliverStep():
                mission.late_min = (outcome.ended_at - promised_at).total_seconds() / 60
            case RechargeStep():
                self.learned = self.learned.after_recharge(health_of(seen))
                planned = steps[step.step_id - 1]
                session = planned.planned_end_at - planned.planned_start_at
                is_short = outcome.ended_at - last.run.started_at > session + _TOO_SHORT
                mission.short_sessions += is_short and step.step_id < len(steps) - 1
            case _:
                pass


def _charging(
    station_id: StationId, at: datetime, *, first_step: int
) -> tuple[RechargeStep, WaitStep]:
    """Charging after the mission, and standing there."""
    charge = RechargeStep(
        step_id=first_step,
        planned_start_at=at,
        planned_end_at=at,
        station_id=station_id,
        pad=0,
        not_before_at=at,
        until_soc=_READY_SOC,
        not_after_at=at,
    )
    until_at = at + timedelta(minutes=10)
    wait = WaitStep(
        step_id=first_step + 1,
        planned_start_at=at,
        planned_end_at=until_at,
        station_id=station_id,
        until_at=until_at + timedelta(days=1),
    )
    return charge, wait


def _open_ended(step: FlightStep) -> FlightStep:
    """The step, with a session that lasts until the drone has its charge."""
    if not isinstance(step, RechargeStep):
        return step
    return step.model_copy(update={"not_after_at": step.not_after_at + timedelta(days=1)})


def _refuses(steps: Sequence[FlightStep], seen: Assessment) -> bool:
    """Whether the drone would refuse this mission for lack of energy."""

    def use(flights: LoadedFlights) -> float:
        legs = [leg_of(step, model=MODEL, load_kg=load_kg) for step, load_kg in flights]
        return seen.reach.factor_over(legs)

    short = shortfall_of(steps, model=MODEL, soc=seen.soc, packages=(), energy_use=use)
    return short is not None


def missions_of(
    arguments: argparse.Namespace, network: Network, *, learns: bool
) -> Iterator[FlownMission]:
    """The missions of all drones after the first ones of each."""
    day = changed(read_scenario(arguments.scenario), {"seed": arguments.seed})
    stations = sorted(_connected(network, StationId("san-marcos")))
    for number in range(arguments.drones):
        chance = random.Random(1_000 * arguments.seed + number)
        drone = FlyingDrone(
            DroneId(f"drn_{number}"), day, network, chance.choice(stations), learns=learns
        )
        for mission in range(arguments.missions):
            pickup, destination = _apart(network, stations, chance=chance)
            flown = drone.deliver(pickup, destination, mass_kg=chance.uniform(*_MASS_KG))
            if mission >= _TEACHING:
                yield flown


def _connected(network: Network, first: StationId) -> set[StationId]:
    found, ahead = {first}, [first]
    while ahead:
        new = {each.to_id for each in network.segments_from(ahead.pop())} - found
        found |= new
        ahead.extend(new)
    return found


def _apart(
    network: Network, stations: Sequence[StationId], *, chance: random.Random
) -> tuple[StationId, StationId]:
    while True:
        pickup, destination = chance.sample(stations, 2)
        ends = network.stations[pickup].position, network.stations[destination].position
        if _APART_M[0] < distance_m(*ends) < _APART_M[1]:
            return pickup, destination


def report(missions: Sequence[FlownMission], *, name: str) -> str:
    """One row of figures."""
    late = statistics.quantiles([each.late_min for each in missions], n=10, method="inclusive")
    below = sum(each.least_soc < MODEL.reserve_soc - 1e-3 for each in missions)
    return (
        f"{name:16} {len(missions):8} {late[4]:8.1f} {late[8]:8.1f} "
        f"{sum(each.is_refused for each in missions):8} "
        f"{sum(each.short_sessions for each in missions) / len(missions):14.2f} {below:14}"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly both ways, and print both rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="cold")
    parser.add_argument("--drones", type=int, default=12)
    parser.add_argument("--missions", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    options, network = parser.parse_args(arguments), texas_corridor()
    print(f"{'planned by':16} missions late p50      p90  refused short sessions below reserve")
    for name, learns in (("model", False), ("learned values", True)):
        print(report([*missions_of(options, network, learns=learns)], name=name), flush=True)


if __name__ == "__main__":
    main()
