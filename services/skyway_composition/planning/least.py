"""What a candidate's offer takes at least, in time, price and energy: known without composing."""

import math
from collections.abc import Sequence
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
class Least:
    """Bounds of every candidate's values for one request: no plan goes below them.

    Along the shortest ways, with no wait, charging as fast as the curve is anywhere; pads and
    closures are not looked at.
    """

    skyway: PreparedNetwork
    request: DeliveryRequest
    approaches_m: dict[StationId, float]
    tour_m: float
    #: Of the request: its destinations, its mass, and the lightest of its packages.
    destinations: tuple[StationId, ...]
    payload_kg: float
    lightest_kg: float

    @classmethod
    def of(
        cls, skyway: PreparedNetwork, request: DeliveryRequest, candidates: Sequence[Candidate]
    ) -> Self:
        """The bounds for a request whose places are all in the network, as the candidates' are."""
        pickup = request.pickup.station_id
        destinations = request.destinations
        stops = [each for each in destinations if each != pickup]
        starts = {candidate.station_id for candidate in candidates}
        return cls(
            skyway,
            request,
            least_m_to(skyway.network, pickup, starts),
            least_tour_m(skyway.network, pickup, stops),
            destinations,
            request.payload_kg,
            # Each flight between deliveries carries at least this one.
            min(package.mass_kg for package in request.packages),
        )

    def values(self, alike: Sequence[Candidate]) -> tuple[OfferValues, ...]:
        """The least time, price and energy of an offer by each of these; inf without a way.

        They are alike: same model, place and charge.
        """
        first = alike[0]
        model = with_margin(first.model, self.skyway.settings.energy_margin)
        approach_m = self.approaches_m[first.station_id]
        fastest_mps = max(model.speed_empty_mps, model.speed_full_mps)
        flight_s = approach_m / model.speed_empty_mps + self.tour_m / fastest_mps
        energy_j = (
            approach_m * flight_power_w(model, 0.0) / model.speed_empty_mps
            + self.tour_m * flight_power_w(model, self.lightest_kg) / fastest_mps
        )
        recharging_s = _recharging_s(model, first.soc, energy_j)
        time_s = flight_s + recharging_s + self._stops_s(model, first.station_id)
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

    def _stops_s(self, model: DroneModel, station_id: StationId) -> float:
        """Landing for, and taking, each hand-over and the loading."""
        pickup, settings = self.request.pickup.station_id, self.skyway.settings
        stops = len(self.destinations)
        landings = stops - (pickup in self.destinations) + (station_id != pickup)
        return settings.loading_s + stops * settings.dropoff_s + landings * model.stop_s


def _recharging_s(model: DroneModel, soc: float, energy_j: float) -> float:
    """The least time on pads to fly with this much energy, starting with this charge."""
    usable_j = max(0.0, soc - model.reserve_soc) * model.battery_j
    return max(0.0, energy_j - usable_j) / model.battery_j * fastest_s_per_soc(model)
