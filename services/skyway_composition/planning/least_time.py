"""The least time in which a candidate could deliver: straight flights, no stops, no waiting."""

from collections.abc import Iterable

from skyway.delivery.request import DeliveryRequest
from skyway.drone.model import DroneModel
from skyway.geo import distance_m
from skyway.ids import StationId
from skyway_composition.networks.prepared import PreparedNetwork


def least_delivery_s(
    skyway: PreparedNetwork,
    request: DeliveryRequest,
    *,
    model: DroneModel,
    station_id: StationId,
) -> float:
    """Seconds from the start that no plan from this station beats, by the last delivery."""
    pickup = request.pickup.station_id
    approach_m = _straight_m(skyway, station_id, [pickup])
    farthest_m = _straight_m(skyway, pickup, request.destinations)
    speed_mps = max(model.speed_empty_mps, model.speed_full_mps)
    stops_s = skyway.settings.loading_s + skyway.settings.dropoff_s
    return (approach_m + farthest_m) / speed_mps + stops_s


def _straight_m(skyway: PreparedNetwork, start: StationId, ends: Iterable[StationId]) -> float:
    stations = skyway.network.stations
    longest_m = max(distance_m(stations[start].position, stations[end].position) for end in ends)
    return skyway.straightness * longest_m
