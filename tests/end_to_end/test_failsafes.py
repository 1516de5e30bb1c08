"""Drones in every kind of trouble: each failsafe acts, and every delivery ends."""

import contextlib
import resource
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any
from urllib.parse import urlsplit

import pytest
from skyway_drone_agent.journal.logbook import Logbook

from skyway.contracts.flight_step import FlyStep
from skyway.runtime.clock import load_clock
from tests.end_to_end.broker_proxy import BrokerProxy
from tests.end_to_end.ladder_network import ladders
from tests.end_to_end.troubled_fleets import TroubledFleets

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.fleet_rate(60.0),
    pytest.mark.storage_pair("embedded"),
    pytest.mark.system_name("trouble"),
]

#: A margin so small that a fifth more energy use is trouble, but large enough to charge late.
_SETTINGS = {"currency": "USD", "loading_s": 30, "dropoff_s": 30, "energy_margin": 0.05}

#: The reserve of each drone, as state of charge. Two rungs with a package use 0.79.
_RESERVES = {"low": 0.12, "short": 0.17} | dict.fromkeys(
    ("motor", "gps", "drift", "link", "pad", "empty", "disk", "hot", "worn", "late"), 0.05
)

#: The destinations of the packages on each ladder.
_TRIPS = {
    "motor": ["s3"],
    "gps": ["s3"],
    "drift": ["s3"],
    "link": ["s2", "s3", "s4"],
    "pad": ["s4"],
    "low": ["s3"],
    "short": ["s3"],
    "empty": ["s3"],
    "disk": ["s2", "s3"],
    "worn": ["s2"],
    "late": ["s2"],
}

#: The alarms, the codes of failed steps, and the final state of the delivery.
_EXPECTED = {
    "motor": ({"MOTOR_FAILURE", "FORCED_LANDING"}, {"MOTOR_FAILURE"}, "FAILED"),
    "gps": ({"GPS_LOST", "FORCED_LANDING"}, {"GPS_LOST"}, "FAILED"),
    "drift": ({"GEOFENCE"}, {"GEOFENCE"}, "COMPLETED"),
    "link": (set(), set(), "COMPLETED"),
    "pad": ({"PAD_OCCUPIED"}, {"PAD_OCCUPIED"}, "COMPLETED"),
    "low": ({"BATTERY_LOW"}, set(), "COMPLETED"),
    "short": ({"BATTERY_SHORT"}, {"BATTERY_SHORT"}, "COMPLETED"),
    "empty": ({"BATTERY_EMPTY", "FORCED_LANDING"}, {"BATTERY_EMPTY"}, "FAILED"),
    "disk": ({"DISK_FULL"}, set(), "COMPLETED"),
    "worn": ({"BATTERY_COLD", "CELL_IMBALANCE", "BATTERY_WORN"}, set(), "COMPLETED"),
    "late": (set(), {"EXPIRED"}, "COMPLETED"),
}

_BY_NAME = """
[motor]
share = 1.0
after_s = 120
drone_ids = ["{motor}"]

[gps]
share = 1.0
after_s = 120
for_s = 3600
drone_ids = ["{gps}"]

[drift]
share = 1.0
after_s = 300
most_m = 900
drone_ids = ["{drift}"]

[[pads.taken]]
station_id = "pad-s3"
from_at = 2020-01-01T00:00:00Z
until_at = 2120-01-01T00:00:00Z
"""

#: A drone that is ready for this long (fleet time; 5 s of wall time) without taking off is being
#: kept on the ground: a drone that may take off needs less time.
_KEPT_FOR = timedelta(seconds=300)

_HIGH_ENERGY_USE = "flight_energy_factor = 1.18"

#: The charger is faster than the model's, because charging is slower in the cold: what a battery
#: holds shows only once it is full.
_WORN = """
charge_time_factor = 0.8

[battery]
temperature_c = -1
worn_share = 1.0
capacity = 0.75
resistance_factor = 2.0
cell_spread_v = 0.15
"""


def test_every_failsafe_acts_and_every_delivery_ends(system: Any) -> None:
    system.operate("PUT", "/v1/networks/failsafes", ladders(*_RESERVES) | {"settings": _SETTINGS})
    fleets = TroubledFleets(system, _RESERVES)
    with contextlib.ExitStack() as proxies:
        late, lost, low, short = (proxies.enter_context(broker_proxy(system)) for _ in range(4))
        start(fleets, late=late, lost=lost, low=low, short=short)
        # Otherwise the cloud lets the drones charge as soon as it sees that they use more energy.
        held = {"low": low, "short": short}
        deliveries = {name: requested(system, name) for name in held}
        for name, proxy in held.items():
            until_accepted(system, fleets, name)
            proxy.hold("instructions")
        others = _TRIPS.keys() - held.keys() - {"late"}
        deliveries |= {name: requested(system, name) for name in others}

        until_airborne(system, fleets, "link", deliveries["link"])
        lost.cut()
        until_alarmed(system, fleets, "low", {"BATTERY_LOW"})
        low.release()
        until_alarmed(system, fleets, "short", {"BATTERY_SHORT"})
        short.release()
        fill_disk_in_flight(system, fleets, deliveries["disk"])
        # This comes last. A state that the drone sends between the expiry and the acks says that it
        # does not fly, and then composition may give the mission up by itself.
        late.hold("acks")
        deliveries["late"] = requested(system, "late")
        until_expired(system, fleets, "late")
        late.release()
        ready_at = until_kept_on_the_ground(system, fleets, "link")
        found_at = load_clock(system.folder.clock_file).now()
        lost.restore()
        ended = {name: system.until_ended(each) for name, each in deliveries.items()}

        expected = {name: state for name, (_, _, state) in _EXPECTED.items()}
        assert {name: delivery["state"] for name, delivery in ended.items()} == expected, ended
        assert next_take_off(system, fleets, "link", after=ready_at) >= found_at
        for name, (alarms, failures, _) in _EXPECTED.items():
            until_alarmed(system, fleets, name, alarms)
            assert failures <= fleets.failures(name), name
        until_alarmed(system, fleets, "hot", {"BATTERY_HOT"})
        assert fleets.alarms("hot") == {"BATTERY_HOT"}


def requested(system: Any, name: str) -> str:
    """The id of a new delivery for the drone with this name."""
    stops = [f"{name}-{stop}" for stop in _TRIPS[name]]
    delivery_id: str = system.request_delivery(stops, pickup=f"{name}-s1")
    return delivery_id


def start(
    fleets: TroubledFleets,
    *,
    late: BrokerProxy,
    lost: BrokerProxy,
    low: BrokerProxy,
    short: BrokerProxy,
) -> None:
    """Start the agents. A scenario that holds for a whole agent needs its own agent."""
    named = ("motor", "gps", "drift", "pad")
    ids = {name: fleets.drone_id(name) for name in named}
    fleets.run(*named, scenario=_BY_NAME.format(**ids))
    fleets.run("low", scenario=_HIGH_ENERGY_USE, mqtt_url=low.url)
    fleets.run("short", scenario=_HIGH_ENERGY_USE, mqtt_url=short.url)
    fleets.run("empty", scenario="flight_energy_factor = 100.0")
    fleets.run("hot", scenario="[battery]\ntemperature_c = 62")
    fleets.run("worn", scenario=_WORN)
    fleets.run("disk", scenario="")
    fleets.run("late", scenario="", mqtt_url=late.url)
    fleets.run("link", scenario="", mqtt_url=lost.url)
    fleets.until_available()


@contextlib.contextmanager
def broker_proxy(system: Any) -> Iterator[BrokerProxy]:
    broker = urlsplit(system.keys["SKYWAY_MQTT_URL"])
    assert broker.hostname is not None
    assert broker.port is not None
    with BrokerProxy((broker.hostname, broker.port)) as proxy:
        yield proxy


def until_accepted(system: Any, fleets: TroubledFleets, name: str) -> None:
    """Return when the drone's journal holds a mission."""
    system.eventually(lambda: fleets.logbook(name).mission, f"{name} on a mission")


def until_airborne(system: Any, fleets: TroubledFleets, name: str, delivery_id: str) -> None:
    """Return when the drone's journal says that it is airborne."""
    system.eventually(
        lambda: fleets.logbook(name).mission and fleets.logbook(name).is_airborne,
        f"{name} in the air",
        instead=lambda: system.delivery(delivery_id),
    )


def fill_disk_in_flight(system: Any, fleets: TroubledFleets, delivery_id: str) -> None:
    """Let no file of that agent grow, from a flight until after the landing."""
    until_airborne(system, fleets, "disk", delivery_id)
    pid = fleets.processes["disk"].pid
    before = resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))

    def has_landed() -> bool:
        state = fleets.state("disk")
        return state["station_id"] is not None and state["faults"] == ["DISK_FULL"]

    system.eventually(
        has_landed, "the landing with a full disk", instead=lambda: fleets.state("disk")
    )
    resource.prlimit(pid, resource.RLIMIT_FSIZE, before)


def until_expired(system: Any, fleets: TroubledFleets, name: str) -> None:
    """Return when the mission that the drone has accepted has expired."""
    clock = load_clock(system.folder.clock_file)

    def has_expired() -> bool:
        mission = fleets.logbook(name).mission
        return mission is not None and clock.now() > mission.expires_at

    system.eventually(
        has_expired, f"{name}'s mission expired", instead=lambda: fleets.logbook(name)
    )


def until_kept_on_the_ground(system: Any, fleets: TroubledFleets, name: str) -> datetime:
    """The fleet moment since which the drone is ready, when it is being kept on the ground."""
    clock = load_clock(system.folder.clock_file)

    def kept_since() -> datetime | None:
        ready_at = ready_to_take_off(fleets.logbook(name))
        return ready_at if ready_at and clock.now() - ready_at > _KEPT_FOR else None

    what = f"{name} kept on the ground"
    found: datetime = system.eventually(kept_since, what, instead=lambda: fleets.logbook(name))
    return found


def ready_to_take_off(logbook: Logbook) -> datetime | None:
    """The moment since which the drone's mission allows the next take-off; None if it does not."""
    mission = logbook.mission
    if mission is None or not mission.steps or mission.has_failed or mission.is_held:
        return None
    step = mission.steps[0]
    if logbook.is_airborne or mission.began_at is not None or not isinstance(step, FlyStep):
        return None
    return max(mission.free_at, step.planned_start_at)


def next_take_off(system: Any, fleets: TroubledFleets, name: str, *, after: datetime) -> datetime:
    """The first take-off after a moment; the flight home counts too."""
    found: datetime = system.eventually(
        lambda: next((at for at in fleets.take_offs(name) if at > after), None),
        f"{name} taking off after {after}",
        instead=lambda: fleets.missions(name),
    )
    return found


def until_alarmed(system: Any, fleets: TroubledFleets, name: str, codes: set[str]) -> None:
    """Return when the drone has an alarm with each of these codes."""
    system.eventually(
        lambda: codes <= fleets.alarms(name),
        f"{codes} of {name}",
        instead=lambda: (fleets.alarms(name), fleets.missions(name)),
    )
