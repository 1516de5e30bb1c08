"""A situation as the arrays that the kernels read."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np

from skyway.drone.charging import fastest_s_per_soc
from skyway.drone.model import DroneModel
from skyway.drone.power import MASS_EXPONENT
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.closures import Interval
from skyway.planner.kernels.memory import Floats, Ints
from skyway.planner.kernels.records import Book, Closed
from skyway.planner.pad_book import PadBook
from skyway.planner.situation import Situation
from skyway.units import CHARGE_TOLERANCE, TIME_TOLERANCE_S

Number = TypeVar("Number", float, Floats)


@dataclass(frozen=True, slots=True)
class Method:
    """How the exact search works; all but the default is for finding out what a part is worth.

    `bound` is what guides it: flying and charging, flying alone, or nothing. Without `dominance`
    every label is kept. `charging` is decided as late as possible, or at once: then it is the
    number of levels tried on each pad, and the plan is no longer proven to be the best.
    """

    bound: Literal["full", "flight", "none"] = "full"
    dominance: Literal["full", "none"] = "full"
    charging: Literal["lazy"] | int = "lazy"


def book_of(book: PadBook) -> Book:
    """A pad book as the kernels read it."""
    return Book(book.station, book.pad, book.start_ms, book.end_ms, book.zero_ms)


def closed_of(situation: Situation) -> Closed:
    """All closures, by segment row and by station row counted on from the last segment."""
    network = situation.network
    first_station_key = len(network.columns.length_m)
    rows: dict[int, tuple[Interval, ...]] = {}
    for what, intervals in situation.closures.intervals().items():
        if isinstance(what, tuple):
            rows[_segment_row(network, *what)] = intervals
        else:
            rows[first_station_key + network.row_of[what]] = intervals
    keys = sorted(rows)
    flat = [interval for key in keys for interval in rows[key]]
    times_s = np.array(flat, np.float64).reshape(-1, 2)
    return Closed(
        np.array(keys, np.int64),
        np.cumsum([0, *(len(rows[key]) for key in keys)], dtype=np.int64),
        np.ascontiguousarray(times_s[:, 0]),
        np.ascontiguousarray(times_s[:, 1]),
        first_station_key,
    )


def _segment_row(network: Network, from_id: StationId, to_id: StationId) -> int:
    outgoing, row = network.outgoing, network.row_of[from_id]
    leaving = slice(outgoing.offsets[row], outgoing.offsets[row + 1])
    place = int(np.flatnonzero(outgoing.station[leaving] == network.row_of[to_id])[0])
    return int(outgoing.segment[leaving][place])


@dataclass(frozen=True, slots=True)
class Legs:
    """What flying costs by mask; ``(2**k + 1,)`` each, the last row is the approach."""

    s_per_m: Floats
    j_per_m: Floats


def legs_of(situation: Situation) -> Legs:
    """Seconds and joules per metre for every set of packages on board."""
    model, destinations = situation.model, situation.destinations
    masses_kg = [
        math.fsum(package.mass_kg for package in situation.packages_for(destination))
        for destination in destinations
    ]
    masks = np.arange(1 << len(destinations))
    loads_kg = np.zeros(len(masks) + 1)
    for number, mass_kg in enumerate(masses_kg):
        loads_kg[:-1] += np.where(masks >> number & 1, 0.0, mass_kg)
    # `skyway.drone` computes one load at a time; here are thousands, by the same formulas.
    share_of_payload = loads_kg / model.max_payload_kg
    speeds_mps = model.speed_empty_mps + share_of_payload * (
        model.speed_full_mps - model.speed_empty_mps
    )
    powers_w = model.power_empty_w * (1.0 + loads_kg / model.empty_mass_kg) ** MASS_EXPONENT
    s_per_m = 1.0 / speeds_mps
    return Legs(s_per_m, powers_w * s_per_m)


@dataclass(frozen=True, slots=True)
class Weights:
    """By what a bound counts: so much for each second flown, so much for each joule used."""

    per_second: float
    per_joule: float

    def of(self, seconds: Number, joules: Number) -> Number:
        """The count of these seconds and joules."""
        return self.per_second * seconds + self.per_joule * joules


def weights_of(model: DroneModel, recharge_policy: str, method: Method) -> tuple[Weights, Weights]:
    """The weights of both bounds, of flying alone and of the need to charge (see `Task`).

    Just above the reserve the concave curve is fastest; sessions that go on to its top are counted
    by their joules, whose time is worked out from what is on board.
    """
    if method.bound == "none":
        return Weights(0.0, 0.0), Weights(0.0, 0.0)
    flying = Weights(1.0, 0.0)
    if recharge_policy == "full":
        return flying, Weights(0.0, 1.0 if method.bound == "full" else 0.0)
    s_per_j = fastest_s_per_soc(model) / model.battery_j
    return flying, Weights(1.0, s_per_j if method.bound == "full" else 0.0)


def curve_of(model: DroneModel) -> tuple[Floats, Floats]:
    """The charge curve: seconds, and joules, ``(n_points,)`` each."""
    seconds = np.array([point.time_s for point in model.charge_curve], np.float64)
    levels_j = [point.soc * model.battery_j for point in model.charge_curve]
    return seconds, np.array(levels_j, np.float64)


def required_before(situation: Situation, order: Sequence[StationId] | None) -> Ints:
    """For each destination, as a mask, what must be delivered before it."""
    destinations = situation.destinations
    required = np.zeros(len(destinations), np.int32)
    delivered = 0
    for station_id in order or ():
        number = destinations.index(station_id)
        required[number] = delivered
        delivered |= 1 << number
    return required


def rounding_j(model: DroneModel) -> float:
    """Charges closer than this are equal, joules."""
    return CHARGE_TOLERANCE * model.battery_j


def latest_s(situation: Situation) -> float:
    """The last moment at which everything may be delivered, with the tolerance; inf without one."""
    limit_s = situation.problem.latest_delivery_s
    return math.inf if limit_s is None else limit_s + TIME_TOLERANCE_S
