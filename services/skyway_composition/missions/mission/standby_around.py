"""Plans another standby for a mission whose service stays as it is."""

from skyway.contracts.flight_step import FlightStep
from skyway.contracts.mission import Mission
from skyway.scheduling.standby import StandbyChoice
from skyway.scheduling.trip import NoTrip, Trip
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.missions.mission.from_trip import StepTerms, finished_wait, flight_steps
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.planning.find_trip import way_home
from skyway_composition.planning.problem_for import Standing
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World


async def trip_with_other_standby(
    solver: SolverPool, world: World, record: MissionRecord, *, energy_margin: float = 0.0
) -> Trip | NoTrip:
    """The mission's trip with the best standby in this world after the same service.

    The mission has stays. Its pads count as free in `world`. The drone's own `energy_margin` counts
    if it is larger than the network's.
    """
    served, candidate = record.stays[0], record.candidate
    return await way_home(
        solver,
        world,
        record.mission.plan,
        standing=Standing(candidate.model, served.soc_from, served.station_id, energy_margin),
        standby=StandbyChoice.of(candidate),
        start_ms=moment_to_ms(record.mission.start_at),
    )


def with_standby_of(mission: Mission, trip: Trip, *, revision: int) -> Mission:
    """The mission as this revision, with the standby of a trip that has the same service."""
    return mission.model_copy(
        update={
            "revision": revision,
            "released_at": ms_to_moment(trip.released_ms),
            "home_plan": trip.home_plan,
            "home_recharge": trip.home_recharge,
        }
    )


def standby_steps(
    record: MissionRecord, trip: Trip, world: World, *, first_step: int
) -> tuple[FlightStep, ...]:
    """The steps of a trip's standby; a wait of no duration if it has none."""
    skyway = world.skyway
    steps = flight_steps(
        skyway.network,
        [*trip.steps()][len(trip.plan.steps) :],
        terms=StepTerms.of(record, skyway.settings),
        first_step=first_step,
    )
    if steps:
        return steps
    station_id = record.stays[0].station_id
    return (finished_wait(station_id, trip.home_start_ms, step_id=first_step),)
