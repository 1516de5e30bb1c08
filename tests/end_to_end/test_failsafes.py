"""Drones in every kind of trouble, side by side: each failsafe acts, and every delivery ends."""

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
from tests.end_to_end.broker_way import BrokerWay
from tests.end_to_end.ladders import ladders
from tests.end_to_end.troubled_fleets import TroubledFleets

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.fleet_rate(60.0),
    pytest.mark.storage_pair("embedded"),
]

#: So little margin that a fifth more thirst is trouble, and enough to begin charging late.
_SETTINGS = {"currency": "USD", "loading_s": 30, "dropoff_s": 30, "energy_margin": 0.05}

#: What each drone keeps of its battery, of which two rungs take 0.79 with a package.
_RESERVES = {"low": 0.12, "short": 0.17} | dict.fromkeys(
    ("motor", "gps", "drift", "link", "pad", "empty", "disk", "hot", "worn", "late"), 0.05
)

#: Where the packages of each ladder go.
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

#: Alarms, why steps failed, and the delivery's end.
_SEEN = {
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

#: A drone that was ready for so long (fleet time; 5 s of wall time) and has not taken off is kept
#: from that: nothing that it does by itself takes as long.
_KEPT_FOR = timedelta(seconds=300)

_THIRSTY = "flight_energy_factor = 1.18"

_WORN = """
[battery]
temperature_c = -8
worn_share = 1.0
capacity = 0.75
resistance_factor = 2.0
cell_spread_v = 0.15
"""


def test_every_failsafe_acts_and_every_delivery_ends(system: Any) -> None:
    system.operate("PUT", "/v1/networks/failsafes", ladders(*_RESERVES) | {"settings": _SETTINGS})
    fleets = TroubledFleets(system, _RESERVES)
    with contextlib.ExitStack() as ways:
        late, lost, short = (ways.enter_context(way_to_broker(system)) for _ in range(3))
        start(fleets, late=late, lost=lost, short=short)
        # Else the cloud has it land, as soon as it says that its battery will be low.
        deliveries = {"short": requested(system, "short")}
        until_accepted(system, fleets, "short")
        short.hold("instructions")
        others = _TRIPS.keys() - {"short", "late"}
        deliveries |= {name: requested(system, name) for name in others}

        until_airborne(system, fleets, "link", deliveries["link"])
        lost.cut()
        until_alarmed(system, fleets, "short", {"BATTERY_SHORT"})
        short.let_go()
        fill_disk_in_flight(system, fleets, deliveries["disk"])
        # Last, with nothing else to wait for: a state that its drone sends between the expiry and
        # the acks says that it does not fly, and composition may give the mission up on its own.
        late.hold("acks")
        deliveries["late"] = requested(system, "late")
        until_expired(system, fleets, "late")
        late.let_go()
        ready_at = until_kept_on_the_ground(system, fleets, "link")
        found_at = load_clock(system.folder.clock_file).now()
        lost.restore()
        ended = {name: system.until_ended(each) for name, each in deliveries.items()}

        expected = {name: state for name, (_, _, state) in _SEEN.items()}
        assert {name: delivery["state"] for name, delivery in ended.items()} == expected, ended
        assert next_take_off(system, fleets, "link", after=ready_at) >= found_at
        for name, (alarms, failures, _) in _SEEN.items():
            until_alarmed(system, fleets, name, alarms)
            assert failures <= fleets.failures(name), name
        until_alarmed(system, fleets, "hot", {"BATTERY_HOT"})
        assert fleets.alarms("hot") == {"BATTERY_HOT"}


def requested(system: Any, name: str) -> str:
    """The delivery that is requested of the drone of this name."""
    stops = [f"{name}-{stop}" for stop in _TRIPS[name]]
    delivery_id: str = system.request_delivery(stops, pickup=f"{name}-s1")
    return delivery_id


def start(fleets: TroubledFleets, *, late: BrokerWay, lost: BrokerWay, short: BrokerWay) -> None:
    """The agents; what is the same for all drones of an agent needs agents of its own."""
    named = ("motor", "gps", "drift", "pad")
    ids = {name: fleets.drone_id(name) for name in named}
    fleets.run(*named, scenario=_BY_NAME.format(**ids))
    fleets.run("low", scenario=_THIRSTY)
    fleets.run("short", scenario=_THIRSTY, mqtt_url=short.url)
    fleets.run("empty", scenario="flight_energy_factor = 100.0")
    fleets.run("hot", scenario="[battery]\ntemperature_c = 62")
    fleets.run("worn", scenario=_WORN)
    fleets.run("disk", scenario="")
    fleets.run("late", scenario="", mqtt_url=late.url)
    fleets.run("link", scenario="", mqtt_url=lost.url)
    fleets.until_available()


@contextlib.contextmanager
def way_to_broker(system: Any) -> Iterator[BrokerWay]:
    broker = urlsplit(system.environment.get("SKYWAY_MQTT_URL", system.keys["SKYWAY_MQTT_URL"]))
    assert broker.hostname is not None
    assert broker.port is not None
    with BrokerWay((broker.hostname, broker.port)) as way:
        yield way


def until_accepted(system: Any, fleets: TroubledFleets, name: str) -> None:
    """Return once the drone has written down that it has a mission."""
    system.eventually(lambda: fleets.logbook(name).mission, f"{name} on a mission")


def until_airborne(system: Any, fleets: TroubledFleets, name: str, delivery_id: str) -> None:
    """Return once the drone has written down that it takes off."""
    system.eventually(
        lambda: fleets.logbook(name).mission and fleets.logbook(name).is_airborne,
        f"{name} in the air",
        told=lambda: system.delivery(delivery_id),
    )


def fill_disk_in_flight(system: Any, fleets: TroubledFleets, delivery_id: str) -> None:
    """From a flight until after its landing no file of that agent can grow."""
    until_airborne(system, fleets, "disk", delivery_id)
    pid = fleets.processes["disk"].pid
    before = resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))

    def has_landed() -> bool:
        state = fleets.state("disk")
        return state["station_id"] is not None and state["faults"] == ["DISK_FULL"]

    system.eventually(has_landed, "the landing with a full disk", told=lambda: fleets.state("disk"))
    resource.prlimit(pid, resource.RLIMIT_FSIZE, before)


def until_expired(system: Any, fleets: TroubledFleets, name: str) -> None:
    """Return once the mission that the drone has accepted may not be begun any more."""
    clock = load_clock(system.folder.clock_file)

    def has_expired() -> bool:
        mission = fleets.logbook(name).mission
        return mission is not None and clock.now() > mission.expires_at

    system.eventually(has_expired, f"{name}'s mission expired", told=lambda: fleets.logbook(name))


def until_kept_on_the_ground(system: Any, fleets: TroubledFleets, name: str) -> datetime:
    """The fleet moment since which the drone could have taken off, once it is kept from that."""
    clock = load_clock(system.folder.clock_file)

    def kept_since() -> datetime | None:
        ready_at = ready_to_take_off(fleets.logbook(name))
        return ready_at if ready_at and clock.now() - ready_at > _KEPT_FOR else None

    what = f"{name} kept on the ground"
    found: datetime = system.eventually(kept_since, what, told=lambda: fleets.logbook(name))
    return found


def ready_to_take_off(logbook: Logbook) -> datetime | None:
    """Since when nothing in the drone's mission says that it should not take off."""
    mission = logbook.mission
    if mission is None or not mission.steps or mission.has_failed or mission.is_held:
        return None
    step = mission.steps[0]
    if logbook.is_airborne or mission.began_at is not None or not isinstance(step, FlyStep):
        return None
    return max(mission.free_at, step.planned_start_at)


def next_take_off(system: Any, fleets: TroubledFleets, name: str, *, after: datetime) -> datetime:
    """The first take-off after a moment, for home if not before."""
    found: datetime = system.eventually(
        lambda: next((at for at in fleets.take_offs(name) if at > after), None),
        f"{name} taking off after {after}",
        told=lambda: fleets.missions(name),
    )
    return found


def until_alarmed(system: Any, fleets: TroubledFleets, name: str, codes: set[str]) -> None:
    """Return once there is an alarm of each of these codes about the drone."""
    system.eventually(
        lambda: codes <= fleets.alarms(name),
        f"{codes} of {name}",
        told=lambda: (fleets.alarms(name), fleets.missions(name)),
    )
