"""What a candidate's offer takes at least, in time, price and energy: known without composing."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from skyway.contracts.candidate import Candidate
from skyway.delivery.offer import OfferValues, price_of
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

    @classmethod
    def of(
        cls, skyway: PreparedNetwork, request: DeliveryRequest, candidates: Sequence[Candidate]
    ) -> Self:
        """The bounds for a request whose places are all in the network, as the candidates' are."""
        pickup = request.pickup.station_id
        stops = [each for each in request.destinations if each != pickup]
        starts = {candidate.station_id for candidate in candidates}
        return cls(
            skyway,
            request,
            least_m_to(skyway.network, pickup, starts),
            least_tour_m(skyway.network, pickup, stops),
        )

    def values(self, candidate: Candidate) -> OfferValues:
        """The least time, price and energy of an offer by this candidate; inf without a way."""
        model = with_margin(candidate.model, self.skyway.settings.energy_margin)
        approach_m = self.approaches_m[candidate.station_id]
        # The last flight carries a package still, the heaviest only if there is no other.
        lightest_kg = min(package.mass_kg for package in self.request.packages)
        fastest_mps = max(model.speed_empty_mps, model.speed_full_mps)
        flight_s = approach_m / model.speed_empty_mps + self.tour_m / fastest_mps
        energy_j = (
            approach_m * flight_power_w(model, 0.0) / model.speed_empty_mps
            + self.tour_m * flight_power_w(model, lightest_kg) / fastest_mps
        )
        recharging_s = _recharging_s(model, candidate.soc, energy_j)
        least_m = approach_m + self.tour_m
        price = (
            price_of(
                candidate.tariff,
                distance_m=least_m,
                payload_kg=self.request.payload_kg,
                recharging_s=recharging_s,
            ).amount
            if least_m < float("inf")
            else 0
        )
        return OfferValues(
            time_s=flight_s + recharging_s + self._stops_s(model, candidate.station_id),
            price=price,
            energy_j=energy_j,
            provider_id=candidate.provider_id,
            drone_id=candidate.drone_id,
        )

    def _stops_s(self, model: DroneModel, station_id: StationId) -> float:
        """Landing for, and taking, each hand-over and the loading."""
        pickup, settings = self.request.pickup.station_id, self.skyway.settings
        stops = len(self.request.destinations)
        landings = stops - (pickup in self.request.destinations) + (station_id != pickup)
        return settings.loading_s + stops * settings.dropoff_s + landings * model.stop_s


def _recharging_s(model: DroneModel, soc: float, energy_j: float) -> float:
    """The least time on pads to fly with this much energy, starting with this charge."""
    usable_j = max(0.0, soc - model.reserve_soc) * model.battery_j
    return max(0.0, energy_j - usable_j) / model.battery_j * fastest_s_per_soc(model)
