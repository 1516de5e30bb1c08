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
from skyway_composition.networks.settings import NetworkSettings
from skyway_composition.planning.margins import with_margin
from skyway_composition.planning.ways import least_m_to, least_tour_m


@dataclass(frozen=True, slots=True)
class _Pace:
    """What drones of one model take at least: to the pickup by the metre, and after it in all.

    `stops_s` are all stops of a drone that stands at the pickup; any other lands there, too.
    """

    approach_s_per_m: float
    approach_j_per_m: float
    tour_s: float
    tour_j: float
    recharging_s_per_j: float
    stops_s: float
    landing_s: float

    @classmethod
    def of(
        cls,
        model: DroneModel,
        request: DeliveryRequest,
        settings: NetworkSettings,
        *,
        tour_m: float,
    ) -> Self:
        """The pace of a model, margin included, on a tour of this length."""
        fastest_mps = max(model.speed_empty_mps, model.speed_full_mps)
        # Each flight between deliveries carries at least this.
        lightest_kg = min(package.mass_kg for package in request.packages)
        destinations = request.destinations
        stops = len(destinations)
        landings = stops - (request.pickup.station_id in destinations)
        return cls(
            approach_s_per_m=1 / model.speed_empty_mps,
            approach_j_per_m=flight_power_w(model, 0.0) / model.speed_empty_mps,
            tour_s=tour_m / fastest_mps,
            tour_j=tour_m * flight_power_w(model, lightest_kg) / fastest_mps,
            recharging_s_per_j=fastest_s_per_soc(model) / model.battery_j,
            stops_s=settings.loading_s + stops * settings.dropoff_s + landings * model.stop_s,
            landing_s=model.stop_s,
        )


@dataclass(frozen=True, slots=True)
class Least:
    """Bounds of every candidate's values for one request: no plan goes below them.

    Along the shortest ways, with no wait, charging as fast as the curve is anywhere; pads and
    closures are not looked at.
    """

    pickup: StationId
    approaches_m: Mapping[StationId, float]
    tour_m: float
    payload_kg: float
    paces: Mapping[DroneModel, _Pace]

    @classmethod
    def of(
        cls, skyway: PreparedNetwork, request: DeliveryRequest, candidates: Sequence[Candidate]
    ) -> Self:
        """The bounds for a request whose places are all in the network, as the candidates' are."""
        network, settings = skyway.network, skyway.settings
        pickup = request.pickup.station_id
        stops = [each for each in request.destinations if each != pickup]
        tour_m = least_tour_m(network, pickup, stops)
        return cls(
            pickup,
            least_m_to(network, pickup, {each.station_id for each in candidates}),
            tour_m,
            request.payload_kg,
            {
                model: _Pace.of(
                    with_margin(model, settings.energy_margin), request, settings, tour_m=tour_m
                )
                for model in {each.model for each in candidates}
            },
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
        time_s = approach_m * pace.approach_s_per_m + pace.tour_s + recharging_s + pace.stops_s
        if first.station_id != self.pickup:
            time_s += pace.landing_s
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
