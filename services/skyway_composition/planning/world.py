"""The world in which plans are made: a network version, its reservations and its closures.

`compose_in` reads only the reservations that a plan needs.
"""

from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from skyway.contracts.shortlist import Shortlist
from skyway.contracts.weather import WeatherNote
from skyway.delivery.plan import Plan, Recharge
from skyway.drone.learned_values import UNKNOWN_USE, LearnedValues
from skyway.drone.model import DroneModel
from skyway.geo import Box
from skyway.ids import DroneModelId, HoldId, MissionId, StationId
from skyway.network.columns import Rows
from skyway.network.great_circle import beside_deg
from skyway.network.network import Network
from skyway.planner.compose import DEFAULT_STRATEGY
from skyway.planner.energy_risk import EnergyRisk
from skyway.planner.problem import Problem
from skyway.planner.weather import Weather
from skyway.runtime.sql.database import Database
from skyway.scheduling.trip import BookedPad
from skyway.units import moment_to_ms
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.conditions import Conditions
from skyway_composition.networks.prepared import PreparedNetwork, PreparedNetworks
from skyway_composition.networks.store import Present
from skyway_composition.pads.pad_snapshot import PadSnapshot
from skyway_composition.planning.solver_pool import SolverPool

#: How far around a request's places pads are read first, as a share of the distance between them.
#: Our own choice: most detours to recharge lie within this margin.
_FIRST_MARGIN: Final = 0.25

#: How often the box around the places is widened before the whole network is read.
_MOST_BOXES: Final = 3


@dataclass(frozen=True, slots=True)
class World:
    """The world of a plan; who stores the plan checks with `calendar.commit` that it still holds.

    The database itself checks reservations. In a network with a `reserve_risk` the margins of plans
    depend on `use_deviation`, that of the plan's drone: see `for_drone`.
    """

    skyway: PreparedNetwork
    pads: PadSnapshot
    conditions: Conditions
    conditions_version: int
    use_deviation: float = UNKNOWN_USE

    @property
    def present(self) -> Present:
        """Version and conditions of the network, which must be unchanged when a plan is stored."""
        skyway = self.skyway
        return Present(skyway.network_id, skyway.version, self.conditions_version)

    async def weather(self, model: DroneModel, start_ms: int) -> Weather | None:
        """The weather for a plan of this model from this moment; None if plans assume still air."""
        known = self.conditions.weather
        if known is None:
            return None
        return await known.of_plan(model, start_ms, use_deviation=self.use_deviation)

    @property
    def risk(self) -> EnergyRisk | None:
        """What the energy margin follows from; None if it is a constant of the network."""
        accepted = self.skyway.settings.reserve_risk
        return None if accepted is None else EnergyRisk(accepted, self.use_deviation)

    def for_drone(self, learned: LearnedValues) -> Self:
        """The same world for plans of the drone about which this was learned."""
        if self.risk is None:
            return self
        deviation = learned.still_air_deviation
        if self.conditions.weather is not None:
            deviation = self.conditions.weather.planned_deviation(deviation)
        return replace(self, use_deviation=deviation)

    def energy_margin(self, model: DroneModel) -> float:
        """The share of energy that plans of this model add to all flights.

        With a `reserve_risk` and a forecast the weather adds what the error of its wind needs.
        """
        risk = self.risk
        if risk is None:
            return self.skyway.settings.energy_margin
        is_forecast = self.conditions.weather is not None
        return risk.own_margin if is_forecast else risk.climate_margin(model)

    def energy_margins(self, shortlist: Shortlist) -> dict[Hashable, float]:
        """The energy margin of each kind of drone; empty if all have the network's."""
        if self.risk is None:
            return {}
        learned = dict(zip(shortlist.kinds, shortlist.each_learned, strict=True))
        return {
            kind: self.for_drone(learned[kind]).energy_margin(model)
            for kind, model in shortlist.planned_model_of.items()
            if kind in learned
        }

    def least_time_factors(
        self, models: Mapping[DroneModelId, DroneModel]
    ) -> dict[DroneModelId, float]:
        """By model: a lower bound of the time factors of its flights; empty in still air."""
        known = self.conditions.weather
        if known is None:
            return {}
        return {model_id: known.least_time_factor(model) for model_id, model in models.items()}

    def weather_note(self, at_ms: int) -> WeatherNote | None:
        """The forecast that a plan from this moment uses; None if plans assume still air."""
        known = self.conditions.weather
        return None if known is None else known.note_at(at_ms)

    def in_still_air(self) -> Self:
        """The same world without weather."""
        return replace(self, conditions=replace(self.conditions, weather=None))

    def without(self, owners: Collection[MissionId | HoldId]) -> Self:
        """The same world, in which the pads of these missions and holds count as free."""
        return replace(self, pads=self.pads.without(owners))

    def anew(self) -> Self:
        """The same world, in which pads are read again."""
        return replace(self, pads=self.pads.anew())

    def instead(self, pads: Mapping[MissionId, Collection[BookedPad]]) -> Self:
        """The same world, in which these missions have reserved exactly these pads."""
        return replace(self, pads=self.pads.instead(pads))

    @classmethod
    async def around(
        cls, station_id: StationId, networks: PreparedNetworks, *, db: Database, after_ms: int
    ) -> Self | None:
        """The world of the network that has this station; None when no network has it."""
        present = await networks.present_around(station_id)
        return (
            None if present is None else await cls.at(present, networks, db=db, after_ms=after_ms)
        )

    @classmethod
    async def at(
        cls,
        present: Present,
        networks: PreparedNetworks,
        *,
        db: Database,
        after_ms: int,
        pad_gap_s: float | None = None,
    ) -> Self:
        """The world of a network at a version and conditions number that were just read.

        Reservations begin `pad_gap_s` early; None means the network's own gap.

        Raises
        ------
        Misdirected
            Another composition serves the network.
        """
        networks.own.refuse_foreign(present.network_id)
        skyway = await networks.version(present.network_id, present.version)
        number = present.conditions
        conditions = await skyway.conditions.numbered(number, db, after_ms=after_ms)
        pads = _pads(skyway, db, conditions, after_ms=after_ms, pad_gap_s=pad_gap_s)
        return cls(skyway, pads, conditions, number)

    @classmethod
    async def of(
        cls,
        skyway: PreparedNetwork,
        db: Database,
        *,
        after_ms: int,
        without: Collection[MissionId] = (),
        pad_gap_s: float | None = None,
        supposed: Sequence[Closure] = (),
    ) -> Self:
        """The network with the closures and reservations that end after a moment.

        The reservations of the missions `without` are left out. All others begin `pad_gap_s`
        early; None means the network's own gap. The `supposed` closures were not made: a dry run
        plans as if they were.
        """
        number, conditions = await skyway.conditions.read(db, after_ms=after_ms)
        if supposed:
            conditions = replace(conditions, closures=(*conditions.closures, *supposed))
        pads = _pads(
            skyway,
            db,
            conditions,
            after_ms=after_ms,
            without=without,
            pad_gap_s=pad_gap_s,
        )
        return cls(skyway, pads, conditions, number)


def _pads(
    skyway: PreparedNetwork,
    db: Database,
    conditions: Conditions,
    *,
    after_ms: int,
    without: Collection[MissionId] = (),
    pad_gap_s: float | None = None,
) -> PadSnapshot:
    gap_s = skyway.settings.pad_gap_s if pad_gap_s is None else pad_gap_s
    return PadSnapshot(
        db,
        skyway.network_id,
        skyway.network,
        after_ms=after_ms,
        without=without,
        outages=conditions.pad_outages(after_ms),
        gap_ms=round(gap_s * 1000),
    )


async def compose_in(solver: SolverPool, world: World, problem: Problem) -> Plan:
    """The plan of a problem with a `start_at`, in the weather and the reservations of this world.

    A problem with fewer reservations is easier. If its plan charges only at stations that were
    read, the plan and its proof hold for the whole problem. If it has no plan, the whole problem
    has none. In all other cases more stations are read and the problem is composed again. Only
    the exact search finds the same plan either way; for other strategies all stations are read.
    """
    network = world.skyway.network
    start_ms = 0 if problem.start_at is None else moment_to_ms(problem.start_at)
    weather = await world.weather(problem.drone.model, start_ms)
    if weather is not None:
        problem = problem.model_copy(update={"weather": weather})
    places = {problem.source, problem.start_station_id}
    places.update(package.destination for package in problem.packages)
    margin = _FIRST_MARGIN
    boxes = _MOST_BOXES if problem.strategy in (None, DEFAULT_STRATEGY) else 0
    while True:
        around = _rows_around(network, places, margin) if boxes > 0 else _all_rows(network)
        await world.pads.read(around)
        plan = await solver.compose(
            problem,
            airspace=world.skyway.airspace,
            hierarchy=world.skyway.hierarchy,
            booked=world.pads.book.seen_from(start_ms),
        )
        unread = {each for each in _charging_stations(plan) if not world.pads.has_read(each)}
        if not unread:
            return plan
        places |= unread
        margin *= 2
        boxes -= 1


def _charging_stations(plan: Plan) -> Iterable[StationId]:
    return (step.station_id for step in plan.steps if isinstance(step, Recharge))


def _rows_around(network: Network, places: Iterable[StationId], margin: float) -> Rows:
    """The stations in the box around these places, with a margin as a share of its larger side."""
    columns = network.columns
    rows = [network.row_of[place] for place in places]
    box = Box.around(zip(columns.longitude_deg[rows], columns.latitude_deg[rows], strict=True))
    more_deg = margin * max(box.width_deg, box.north - box.south)
    longitude_deg = beside_deg(columns.longitude_deg, box.west + box.width_deg / 2)
    is_near = (
        (longitude_deg >= box.west - more_deg)
        & (longitude_deg <= box.west + box.width_deg + more_deg)
        & (columns.latitude_deg >= box.south - more_deg)
        & (columns.latitude_deg <= box.north + more_deg)
    )
    return np.flatnonzero(is_near).astype(np.int32)


def _all_rows(network: Network) -> Rows:
    return np.arange(len(network.row_of), dtype=np.int32)
