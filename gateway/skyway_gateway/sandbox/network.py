"""The network of the sandbox: a hub, and stations on a ring around it."""

from math import cos, pi, sin
from typing import TYPE_CHECKING, Final

from skyway.contracts.station_check import NetworkStations
from skyway.geo import Position, distance_m
from skyway.ids import NetworkId, StationId
from skyway.network.parts import Segment, Station
from skyway_gateway.sandbox.outcomes import OUTCOMES

if TYPE_CHECKING:
    from skyway.network.network import Network

NETWORK_ID: Final = NetworkId("test_island")
CURRENCY: Final = "USD"

#: Seconds of fleet time, as the settings of the network say.
LOADING_S: Final = 60.0
DROPOFF_S: Final = 30.0

#: The hub, where most test deliveries begin. The island lies in the ocean and does not exist.
HUB: Final = Station(StationId("harbour"), Position(-30.0, 1.0), name="Harbour")

#: Degrees from the hub to the ring: 4.4 km.
_RADIUS_DEG: Final = 0.04

_RING_NAMES: Final = (
    *((each.station_id, each.station_name) for each in OUTCOMES),
    (StationId("library"), "Library"),
    (StationId("clinic"), "Clinic"),
    (StationId("lighthouse"), "Lighthouse"),
)


def _ring() -> tuple[Station, ...]:
    step = 2 * pi / len(_RING_NAMES)
    return tuple(
        Station(
            station_id,
            Position(
                HUB.position.longitude_deg + _RADIUS_DEG * sin(number * step),
                HUB.position.latitude_deg + _RADIUS_DEG * cos(number * step),
            ),
            name=name,
        )
        for number, (station_id, name) in enumerate(_RING_NAMES)
    )


#: All stations of the sandbox, the hub first.
STATIONS: Final = {each.station_id: each for each in (HUB, *_ring())}


def way(start: StationId, end: StationId) -> tuple[StationId, ...]:
    """The stations from one to another: segments join the hub with each other station."""
    hub = HUB.station_id
    return (start, end) if hub in (start, end) else (start, hub, end)


def length_m(start: StationId, end: StationId) -> float:
    """The length of a segment, metres."""
    return distance_m(STATIONS[start].position, STATIONS[end].position)


def sandbox_network() -> "Network":
    """The network as operators would publish it."""
    # Imported here: networks need NumPy, and most gateways never show this one.
    from skyway.network.network import Network

    hub, others = HUB.station_id, [each for each in STATIONS if each != HUB.station_id]
    pairs = [pair for each in others for pair in ((hub, each), (each, hub))]
    settings = {"currency": CURRENCY, "loading_s": LOADING_S, "dropoff_s": DROPOFF_S}
    segments = [Segment(*pair, length_m=length_m(*pair)) for pair in pairs]
    return Network(STATIONS, segments, settings=settings)


def sandbox_stations() -> NetworkStations:
    """The stations in the form in which composition announces those of a network."""
    return NetworkStations(
        network_id=NETWORK_ID,
        version=1,
        station_ids=tuple(STATIONS),
        positions=tuple(each.position for each in STATIONS.values()),
        parts=(0,) * len(STATIONS),
        names={each.station_id: each.name or "" for each in STATIONS.values()},
        loading_s=LOADING_S,
        dropoff_s=DROPOFF_S,
    )
