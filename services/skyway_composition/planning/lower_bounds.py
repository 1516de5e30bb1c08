"""Lower bounds of each candidate's time, price and energy, found without composing."""

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, NamedTuple, Self, TypeVar

import numpy as np

from skyway.contracts.network_document import NetworkSettings
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import MOST_OF_TRIP, Tariff
from skyway.delivery.qos import Priority
from skyway.delivery.request import DeliveryRequest
from skyway.drone.charging import fastest_s_per_soc
from skyway.drone.flight import flight_power_w
from skyway.drone.model import DroneModel
from skyway.ids import DroneModelId, StationId
from skyway.network.columns import Adjacency, Floats
from skyway.network.network import Network
from skyway.planner.kernels.ways import lengths_from
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.planning.problem_for import with_margin

_Key = TypeVar("_Key")

#: The search ends after this many stations; all others are at least as far as the last of them.
_MOST_SETTLED: Final = 2_000

#: All orders of up to this many destinations are compared; of more only the farthest counts.
_MOST_ORDERED: Final = 6


class _Paces(NamedTuple):
    """The least that drones need: per metre to the pickup, in total after it; ``(n,)`` each.

    `stops_s` is the time of all stops of a drone that stands at the pickup. `landing_s` is added
    for a drone that must first land there.
    """

    approach_s_per_m: Floats
    approach_j_per_m: Floats
    tour_s: Floats
    tour_j: Floats
    recharging_s_per_j: Floats
    stops_s: Floats
    landing_s: Floats
    reserve_soc: Floats
    battery_j: Floats


@dataclass(frozen=True, slots=True)
class LowerBounds:
    """Lower bounds of each candidate's values for one request; ``(n,)`` each.

    They assume shortest ways, no waiting, and charging at the curve's highest power. Pads and
    closures are ignored. Without a way, time and energy are inf and the price is 0.
    """

    time_s: Floats
    price: Floats
    energy_j: Floats

    @classmethod
    def of(
        cls,
        skyway: PreparedNetwork,
        request: DeliveryRequest,
        shortlist: Shortlist,
        *,
        waits_s: Floats,
        time_factors: Mapping[DroneModelId, float] = MappingProxyType({}),
        energy_margins: Mapping[Hashable, float] = MappingProxyType({}),
    ) -> Self:
        """The lower bounds for a request; all its places and the candidates are in the network.

        `waits_s` is how long each candidate begins after the first; ``(n,)``. `time_factors` is
        the least that the weather multiplies the flights of a model by; 1 for all other models.
        `energy_margins` is the margin of each kind of drone; other kinds have the network's.
        """
        network, pickup = skyway.network, request.pickup.station_id
        stops = [each for each in request.destinations if each != pickup]
        tour_m = least_tour_m(network, pickup, stops)
        approach_m = least_m_to(network, pickup, shortlist.station_ids)
        pace = _paces(
            shortlist,
            request,
            skyway.settings,
            tour_m=tour_m,
            time_factors=time_factors,
            energy_margins=energy_margins,
        )

        energy_j = approach_m * pace.approach_j_per_m + pace.tour_j
        usable_j = np.maximum(0.0, np.array(shortlist.socs) - pace.reserve_soc) * pace.battery_j
        recharging_s = np.maximum(0.0, energy_j - usable_j) * pace.recharging_s_per_j
        time_s = approach_m * pace.approach_s_per_m + pace.tour_s + recharging_s + pace.stops_s
        is_elsewhere = np.array([each != pickup for each in shortlist.station_ids])
        time_s += np.where(is_elsewhere, pace.landing_s, 0.0) + waits_s

        has_way = np.isfinite(time_s)
        price = _amounts(
            shortlist,
            distance_m=np.where(has_way, approach_m + tour_m, 0.0),
            payload_kg=request.payload_kg,
            recharging_s=np.where(has_way, recharging_s, 0.0),
            priority=request.qos.priority,
        )
        return cls(time_s, np.where(has_way, price, 0.0), energy_j)


def _paces(
    shortlist: Shortlist,
    request: DeliveryRequest,
    settings: NetworkSettings,
    *,
    tour_m: float,
    time_factors: Mapping[DroneModelId, float],
    energy_margins: Mapping[Hashable, float],
) -> _Paces:
    """The paces of the candidates on a tour of this length, with the energy margin."""
    by_kind = {
        kind: _pace(
            with_margin(model, energy_margins.get(kind, settings.energy_margin)),
            request,
            settings,
            tour_m=tour_m,
            time_factor=time_factors.get(model.model_id, 1.0),
        )
        for kind, model in shortlist.planned_model_of.items()
    }
    return _Paces(*_looked_up(by_kind, shortlist.kinds))


def _pace(
    model: DroneModel,
    request: DeliveryRequest,
    settings: NetworkSettings,
    *,
    tour_m: float,
    time_factor: float,
) -> Sequence[float]:
    """A model's row of `_Paces`; weather may save time, but no plan counts on saved energy."""
    fastest_mps = max(model.speed_empty_mps, model.speed_full_mps)
    # Each flight between deliveries carries at least this mass.
    lightest_kg = min(package.mass_kg for package in request.packages)
    destinations = request.destinations
    stops = len(destinations)
    hand_overs_s = stops * settings.hand_over_s(request.packages)
    landings = stops - (request.pickup.station_id in destinations)
    return (
        time_factor / model.speed_empty_mps,
        flight_power_w(model, 0.0) / model.speed_empty_mps,
        time_factor * tour_m / fastest_mps,
        tour_m * flight_power_w(model, lightest_kg) / fastest_mps,
        fastest_s_per_soc(model) / model.battery_j,
        settings.loading_s + hand_overs_s + landings * model.stop_s,
        model.stop_s,
        model.reserve_soc,
        model.battery_j,
    )


def _amounts(
    shortlist: Shortlist,
    *,
    distance_m: Floats,
    payload_kg: float,
    recharging_s: Floats,
    priority: Priority,
) -> Floats:
    """The price of each candidate's tariff, by the formula of `price_of`."""
    by_provider = {key: _rates(terms.tariff, priority) for key, terms in shortlist.terms_of.items()}
    base, per_km, per_kg, per_recharge_minute, minimum, factor = _looked_up(
        by_provider, shortlist.provider_ids
    )
    amounts: Floats = (
        base
        + per_km * distance_m / 1000
        + per_kg * payload_kg
        + per_recharge_minute * recharging_s / 60
    )
    rounded: Floats = np.rint(np.maximum(minimum, np.rint(amounts)) * factor)
    return np.minimum(rounded, MOST_OF_TRIP)


def _rates(tariff: Tariff, priority: Priority) -> Sequence[float]:
    return (
        tariff.base,
        tariff.per_km,
        tariff.per_kg,
        tariff.per_recharge_minute,
        tariff.minimum,
        tariff.factor_of(priority),
    )


def _looked_up(by_key: Mapping[_Key, Sequence[float]], keys: Sequence[_Key]) -> Floats:
    """The rows of these keys, as columns."""
    number_of = {key: number for number, key in enumerate(by_key)}
    numbers = [number_of[key] for key in keys]
    columns: Floats = np.array([*by_key.values()], np.float64).T[:, numbers]
    return columns


def least_m_to(network: Network, end: StationId, starts: Sequence[StationId]) -> Floats:
    """A lower bound of the way to `end` from each of these stations, metres.

    Closures are ignored; inf where there is no way.
    """
    return _least_m(network, network.incoming, end, starts)


def least_tour_m(network: Network, start: StationId, stops: Sequence[StationId]) -> float:
    """A lower bound of the way from `start` through all of these stations, metres."""
    if not stops:
        return 0.0
    from_start = _row(network, start, stops)
    if len(stops) > _MOST_ORDERED:
        return max(from_start)
    apart = [
        [0.0] * len(stops) if len(stops) == 1 else _row(network, stop, stops) for stop in stops
    ]
    # The shortest way by the visited stops and the last of them (Held and Karp).
    least = {(1 << last, last): least_m for last, least_m in enumerate(from_start)}
    for visited in range(1, 1 << len(stops)):
        for last in range(len(stops)):
            so_far_m = least.get((visited, last))
            if so_far_m is None:
                continue
            for following in range(len(stops)):
                if visited >> following & 1:
                    continue
                key = (visited | 1 << following, following)
                length_m = so_far_m + apart[last][following]
                if length_m < least.get(key, math.inf):
                    least[key] = length_m
    everything = (1 << len(stops)) - 1
    return min(least.get((everything, last), math.inf) for last in range(len(stops)))


def _row(network: Network, start: StationId, ends: Sequence[StationId]) -> list[float]:
    least_m: list[float] = _least_m(network, network.outgoing, start, ends).tolist()
    return least_m


def _least_m(
    network: Network, adjacent: Adjacency, root: StationId, ends: Sequence[StationId]
) -> Floats:
    """The lengths of the shortest ways from the root along these segments."""
    rows = np.array([network.row_of[each] for each in ends], np.int64)
    least_m: Floats = lengths_from(
        adjacent.offsets,
        adjacent.station,
        adjacent.length_m,
        network.row_of[root],
        rows,
        _MOST_SETTLED,
    )
    return least_m
