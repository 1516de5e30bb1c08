"""Drones in every kind of trouble, side by side: each failsafe acts, and every delivery ends."""

import resource
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from typing import Any
from urllib.parse import urlsplit

import pytest
from ladders import ladders
from late_acks import LateAcks
from skyway_drone_agent.link.link_watch import LINK_LOST_AFTER
from skyway_drone_agent.simulated.disturbances import Disturbances, LinkLoss
from skyway_drone_agent.simulated.link_loss import Outage, outages
from troubled_fleets import TroubledFleets

from skyway.ids import DroneId

pytestmark = [pytest.mark.end_to_end, pytest.mark.fleet_rate(60.0)]

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

_TERMINAL = ("COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED")

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

#: Until the link is lost, at least: long enough for a mission to be accepted.
_SOON = timedelta(seconds=12)

#: From the link's return to the next take-off, at most.
_AGAIN = timedelta(seconds=6)

_WORN = """
[battery]
temperature_c = -8
worn_share = 1.0
capacity = 0.75
resistance_factor = 2.0
cell_spread_v = 0.15
"""


#: The link is lost once, for so many wall seconds.
_LINK = "[link]\nshare = 1.0\nevery_s = 600\nfor_s = 25\n"


def test_every_failsafe_acts_and_every_delivery_ends(system: Any) -> None:
    system.operate("PUT", "/v1/networks/ladders", ladders(*_RESERVES) | {"settings": _SETTINGS})
    fleets = TroubledFleets(system, _RESERVES)
    with late_acks(system) as late:
        start(fleets, late)
        outage = start_with_outage(fleets, "link")
        late.hold()
        deliveries = {
            name: system.request_delivery([f"{name}-{stop}" for stop in stops], pickup=f"{name}-s1")
            for name, stops in _TRIPS.items()
        }

        fill_disk_in_flight(system, fleets)
        late.let_go()
        ended = {
            name: system.until_state(delivery_id, *_TERMINAL, within_s=120)
            for name, delivery_id in deliveries.items()
        }

    lost_at = outage.from_at + LINK_LOST_AFTER
    system.eventually(
        lambda: any(at > lost_at for at in fleets.take_offs("link")),
        within_s=60,
        what="a take-off, for home if not before, after the link was lost",
    )
    next_at = min(at for at in fleets.take_offs("link") if at > lost_at)
    assert outage.until_at <= next_at < outage.until_at + _AGAIN
    for name, (alarms, failures, state) in _SEEN.items():
        system.eventually(
            lambda name=name, alarms=alarms: alarms <= fleets.alarms(name),
            within_s=60,
            what=f"{alarms} of {name}",
        )
        assert failures <= fleets.failures(name), name
        assert ended[name]["state"] == state, name
    assert fleets.alarms("hot") == {"BATTERY_HOT"}
    verified = system.command("verify")
    assert verified.returncode == 0, verified.stdout + verified.stderr


def start(fleets: TroubledFleets, late: LateAcks) -> None:
    """The agents; what is the same for all drones of an agent needs agents of its own."""
    named = ("motor", "gps", "drift", "pad")
    ids = {name: fleets.drone_id(name) for name in named}
    fleets.run(*named, scenario=_BY_NAME.format(**ids))
    fleets.run("low", "short", scenario="flight_energy_factor = 1.18")
    fleets.run("empty", scenario="flight_energy_factor = 100.0")
    fleets.run("hot", scenario="[battery]\ntemperature_c = 62")
    fleets.run("worn", scenario=_WORN)
    fleets.run("disk", scenario="")
    fleets.run("late", scenario="", mqtt_url=f"mqtt://127.0.0.1:{late.port}")
    fleets.until_available(but="link")


def start_with_outage(fleets: TroubledFleets, name: str) -> Outage:
    """Its agent, with a day's luck of which the link is lost soon, but not yet."""
    drone_id, loss = DroneId(fleets.drone_id(name)), tomllib.loads(_LINK)["link"]
    now = datetime.now(UTC)
    for seed in range(10_000):
        day = Disturbances(seed=seed, link=LinkLoss(**loss))
        outage = next(outages(now, disturbed=day, drone_id=drone_id))
        if _SOON <= outage.from_at - now <= _SOON * 1.5:
            break
    fleets.run(name, scenario=f"seed = {seed}\n{_LINK}")
    fleets.until_available()
    return outage


@contextmanager
def late_acks(system: Any) -> Iterator[LateAcks]:
    broker = urlsplit(system.environment.get("SKYWAY_MQTT_URL", system.keys["SKYWAY_MQTT_URL"]))
    assert broker.hostname is not None
    assert broker.port is not None
    with LateAcks((broker.hostname, broker.port)) as late:
        yield late


def fill_disk_in_flight(system: Any, fleets: TroubledFleets) -> None:
    """From the first flight until after its landing no file of that agent can grow."""
    system.eventually(
        lambda: fleets.state("disk")["activity"] == "FLYING", within_s=60, what="disk in the air"
    )
    pid = fleets.processes["disk"].pid
    before = resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
    system.eventually(
        lambda: fleets.state("disk")["station_id"] == "disk-s2",
        within_s=30,
        what="the landing with a full disk",
    )
    faults = fleets.state("disk")["faults"]
    resource.prlimit(pid, resource.RLIMIT_FSIZE, before)

    assert faults == ["DISK_FULL"]
