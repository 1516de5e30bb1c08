"""What a candidate's offer takes at least, in time, price and energy: known without composing."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from skyway.contracts.candidate import Candidate
from skyway.delivery.offer import OfferValues, Tariff, amount_of
from skyway.delivery.request import DeliveryRequest
from skyway.drone.charging import fastest_s_per_soc
from skyway.drone.model import DroneModel
from skyway.drone.power import flight_power_w
from skyway.ids import StationId
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.planning.margins import with_margin
from skyway_composition.planning.ways import least_m_to, least_tour_m


@dataclass(frozen=True, slots=True)
class _Pace:
    """What flights of one model take at least: to the pickup by the metre, and after it in all."""

    approach_s_per_m: float
    approach_j_per_m: float
    tour_s: float
    tour_j: float
    recharging_s_per_j: float
    stop_s: float

    @classmethod
    def of(cls, model: DroneModel, *, tour_m: float, least_load_kg: float) -> Self:
        """The pace of a model, margin included, on a tour with at least this load."""
        fastest_mps = max(model.speed_empty_mps, model.speed_full_mps)
        return cls(
            approach_s_per_m=1 / model.speed_empty_mps,
            approach_j_per_m=flight_power_w(model, 0.0) / model.speed_empty_mps,
            tour_s=tour_m / fastest_mps,
            tour_j=tour_m * flight_power_w(model, least_load_kg) / fastest_mps,
            recharging_s_per_j=fastest_s_per_soc(model) / model.battery_j,
            stop_s=model.stop_s,
        )


@dataclass(frozen=True, slots=True)
class Least:
    """Bounds of every candidate's values for one request: no plan goes below them.

    Along the shortest ways, with no wait, charging as fast as the curve is anywhere; pads and
    closures are not looked at.
    """

    skyway: PreparedNetwork
    request: DeliveryRequest
    approaches_m: Mapping[StationId, float]
    tour_m: float
    paces: Mapping[DroneModel, _Pace]
    #: Of the request: its destinations and its mass.
    destinations: tuple[StationId, ...]
    payload_kg: float

    @classmethod
    def of(
        cls, skyway: PreparedNetwork, request: DeliveryRequest, candidates: Sequence[Candidate]
    ) -> Self:
        """The bounds for a request whose places are all in the network, as the candidates' are."""
        pickup = request.pickup.station_id
        destinations = request.destinations
        tour_m = least_tour_m(
            skyway.network, pickup, [each for each in destinations if each != pickup]
        )
        # Each flight between deliveries carries at least this one.
        lightest_kg = min(package.mass_kg for package in request.packages)
        margin = skyway.settings.energy_margin
        return cls(
            skyway,
            request,
            least_m_to(skyway.network, pickup, {each.station_id for each in candidates}),
            tour_m,
            {
                model: _Pace.of(
                    with_margin(model, margin), tour_m=tour_m, least_load_kg=lightest_kg
                )
                for model in {each.model for each in candidates}
            },
            destinations,
            request.payload_kg,
        )

    def values(self, alike: Sequence[Candidate]) -> tuple[OfferValues, ...]:
        """The least time, price and energy of an offer by each of these; inf without a way.

        They are alike: same model, place and charge.
        """
        first = alike[0]
        pace, approach_m = self.paces[first.model], self.approaches_m[first.station_id]
        energy_j = approach_m * pace.approach_j_per_m + pace.tour_j
        usable_j = max(0.0, first.soc - first.model.reserve_soc) * first.model.battery_j
        recharging_s = max(0.0, energy_j - usable_j) * pace.recharging_s_per_j
        flight_s = approach_m * pace.approach_s_per_m + pace.tour_s
        time_s = flight_s + recharging_s + self._stops_s(pace, first.station_id)
        return tuple(
            OfferValues(
                time_s=time_s,
                price=self._price(each.tariff, approach_m + self.tour_m, recharging_s),
                energy_j=energy_j,
                provider_id=each.provider_id,
                drone_id=each.drone_id,
            )
            for each in alike
        )

    def _price(self, tariff: Tariff, least_m: float, recharging_s: float) -> int:
        if math.isinf(least_m):
            return 0
        return amount_of(
            tariff,
            distance_m=least_m,
            payload_kg=self.payload_kg,
            recharging_s=recharging_s,
        )

    def _stops_s(self, pace: _Pace, station_id: StationId) -> float:
        """Landing for, and taking, each hand-over and the loading."""
        pickup, settings = self.request.pickup.station_id, self.skyway.settings
        stops = len(self.destinations)
        landings = stops - (pickup in self.destinations) + (station_id != pickup)
        return settings.loading_s + stops * settings.dropoff_s + landings * pace.stop_s
