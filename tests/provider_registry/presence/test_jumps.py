"""A drone that jumps is taken out of service until a person puts it back."""

from dataclasses import dataclass, field
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.presence import jump_store
from skyway_provider_registry.presence.announce_alarms import AlarmAnnouncer
from skyway_provider_registry.presence.follow import Recorder
from skyway_verifier.registry.rules import RULES

from skyway.contracts.drones import DRONE_ALARMS
from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY
from skyway.geo import Position
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules

pytestmark = pytest.mark.databases("sqlite")

HOME = Position(-97.9, 29.9)


def east(length_m: float) -> Position:
    """A place so far to the east of home."""
    return Position(HOME.longitude_deg + length_m / 96_500, HOME.latitude_deg)


@dataclass
class WatchedDrone:
    """A drone that is online at home, and what the registry makes of its states."""

    api: Any
    db: Database
    clock: ManualClock
    make: Any
    drone: Any
    seq: int = 0
    session: int = 7
    places: dict[str, Position] = field(default_factory=dict)

    async def says(self, **members: Any) -> None:
        self.seq += 1
        await self.sends(STATE, self.make(self.session, self.seq, **members))

    async def sends(self, topic: Any, message: Any) -> None:
        ids = (self.drone["provider_id"], self.drone["drone_id"])
        recorder = Recorder(self.db, self.clock, self.places.get)
        await recorder.record([Received(topic, ids, message, False)])

    async def call(self, method: str, body: Any = None) -> Any:
        path = f"/v1/providers/{self.drone['provider_id']}/drones/{self.drone['drone_id']}"
        return await self.api(f"provider:{self.drone['provider_id']}", method, path, body)

    async def state(self) -> str:
        return str((await self.call("GET")).json()["state"])

    async def details(self) -> list[str]:
        async with self.db.read() as connection:
            return [each.detail for each, _ in await jump_store.waiting(connection, limit=10)]


@pytest.fixture
async def drone(
    api: Any, db: Database, clock: ManualClock, state: Any, online: Any
) -> WatchedDrone:
    watched = WatchedDrone(api, db, clock, state, await api.drone(await api.provider()))
    await watched.sends(CONNECTION, online(7, 1))
    await watched.says(position=HOME, soc=0.5)
    assert await watched.state() == "AVAILABLE"
    return watched


@pytest.mark.parametrize("at_s", [0.0, -3_600.0])
async def test_a_drone_that_is_suddenly_elsewhere_is_taken_out_of_service(
    drone: WatchedDrone, clock: ManualClock, at_s: float
) -> None:
    await drone.says(position=HOME, soc=0.5, at=clock.now() + timedelta(seconds=at_s))
    clock.advance(timedelta(seconds=10))

    await drone.says(position=east(20_000), soc=0.5)

    assert await drone.state() == "MAINTENANCE"
    (detail,) = await drone.details()
    assert detail.startswith("it was 19978 m away")
    assert await broken_rules(drone.db, RULES) == []


@pytest.mark.parametrize("rate", [1.0, 60.0])
async def test_a_drone_in_flight_is_believed(
    drone: WatchedDrone, clock: ManualClock, rate: float
) -> None:
    clock.rate = rate
    for number in range(1, 20):
        clock.advance(timedelta(seconds=30))
        await drone.says(position=east(30 * 23 * number), soc=0.5 - number / 100)

    assert await drone.state() == "AVAILABLE"


async def test_a_wrong_satellite_and_a_message_that_was_long_on_its_way_are_believed(
    drone: WatchedDrone, clock: ManualClock
) -> None:
    clock.advance(timedelta(seconds=20))
    await drone.says(position=east(400), soc=0.5)
    clock.advance(timedelta(seconds=1))
    await drone.says(position=east(400 + 20 * 23), soc=0.55)

    assert await drone.state() == "AVAILABLE"


async def test_a_drone_may_fly_while_its_link_is_lost(
    drone: WatchedDrone, clock: ManualClock
) -> None:
    clock.advance(timedelta(minutes=20))
    await drone.says(position=east(25_000), soc=0.1)

    assert await drone.state() == "AVAILABLE"


async def test_a_drone_that_was_carried_far_while_it_was_off_is_not_believed(
    drone: WatchedDrone, clock: ManualClock
) -> None:
    drone.session, drone.seq = 8, 0
    clock.advance(timedelta(minutes=20))
    await drone.says(position=east(100_000), soc=1.0)

    assert await drone.state() == "MAINTENANCE"


async def test_a_drone_in_maintenance_may_be_carried(
    drone: WatchedDrone, clock: ManualClock
) -> None:
    await drone.call("PATCH", {"state": "MAINTENANCE"})
    await drone.says(position=east(100_000), soc=1.0)
    await drone.call("PATCH", {"state": "AVAILABLE"})
    await drone.says(position=east(100_000), soc=1.0)

    assert await drone.state() == "AVAILABLE"
    assert await drone.details() == []


async def test_a_charge_that_rises_too_fast_is_not_believed(drone: WatchedDrone) -> None:
    await drone.says(position=HOME, soc=0.59)
    assert await drone.state() == "AVAILABLE"

    await drone.says(position=HOME, soc=0.9)

    assert await drone.state() == "MAINTENANCE"
    (detail,) = await drone.details()
    assert detail.startswith("its charge rose from 0.59 to 0.90")


async def test_a_drone_on_a_pad_is_believed(drone: WatchedDrone, clock: ManualClock) -> None:
    clock.advance(timedelta(hours=3))
    await drone.says(position=HOME, soc=1.0, activity="RECHARGING")

    assert await drone.state() == "RECHARGING"


async def test_a_restart_does_not_fill_the_battery(drone: WatchedDrone) -> None:
    drone.session, drone.seq = 8, 0

    await drone.says(position=HOME, soc=1.0)

    assert await drone.state() == "MAINTENANCE"


@pytest.mark.parametrize("rate", [1.0, 60.0])
async def test_many_small_jumps_count_like_a_large_one(
    drone: WatchedDrone, clock: ManualClock, rate: float
) -> None:
    clock.rate = rate
    for number in range(1, 61):
        clock.advance(timedelta(seconds=0.5 * rate))
        await drone.says(position=east(400 * rate * number), soc=0.5)

    assert await drone.state() == "MAINTENANCE"


async def test_many_small_charges_count_like_a_large_one(
    drone: WatchedDrone, clock: ManualClock
) -> None:
    for number in range(1, 11):
        clock.advance(timedelta(seconds=0.5))
        await drone.says(position=HOME, soc=0.5 + number * 0.05)

    assert await drone.state() == "MAINTENANCE"


async def test_a_drone_that_was_ahead_may_be_ahead_again_later(
    drone: WatchedDrone, clock: ManualClock
) -> None:
    """Satellites are wrong now and then: by 400 m, and back."""
    for number in range(20):
        clock.advance(timedelta(seconds=30))
        await drone.says(position=east(400 * (number % 2)), soc=0.5)

    assert await drone.state() == "AVAILABLE"


async def test_a_sample_that_jumps_takes_the_drone_out_of_service(
    drone: WatchedDrone, sample: Any
) -> None:
    at_home = sample(7, 1).model_copy(update={"position": HOME})
    await drone.sends(TELEMETRY, at_home)
    assert await drone.state() == "AVAILABLE"

    far = {"position": east(20_000), "session": 8}
    await drone.sends(TELEMETRY, at_home.model_copy(update=far))

    assert await drone.state() == "MAINTENANCE"


@pytest.mark.parametrize("activity", ["WAITING", "IDLE"])
async def test_a_drone_on_the_ground_is_where_its_station_is(
    drone: WatchedDrone, activity: str
) -> None:
    drone.places = {"s1": HOME, "s2": east(20_000)}
    await drone.says(position=HOME, soc=0.5, station_id="s1", activity=activity)
    assert await drone.details() == []

    await drone.says(position=HOME, soc=0.5, station_id="s2", activity=activity)

    assert await drone.state() == "MAINTENANCE"
    (detail,) = await drone.details()
    assert detail.startswith("it says that it stands at s2, and is 19978 m away from it")


@pytest.mark.parametrize("by", [timedelta(minutes=10), timedelta(days=-30)])
async def test_states_of_the_future_and_of_long_ago_are_dropped(
    drone: WatchedDrone, clock: ManualClock, by: timedelta
) -> None:
    await drone.says(position=HOME, soc=0.5, at=clock.now() + by, activity="RECHARGING")

    assert await drone.state() == "AVAILABLE"


async def test_an_old_state_is_not_judged(drone: WatchedDrone, state: Any) -> None:
    await drone.sends(STATE, state(6, 99, position=east(90_000)))

    assert await drone.state() == "AVAILABLE"


@pytest.mark.parametrize(("session", "seq"), [(6, 99), (7, 1), (7, 2)])
async def test_an_old_sample_that_comes_again_is_not_judged(
    drone: WatchedDrone, sample: Any, session: int, seq: int
) -> None:
    """A broker could repeat it: the drone's signature on it is genuine."""
    await drone.sends(TELEMETRY, sample(7, 2).model_copy(update={"position": HOME}))

    far = {"position": east(90_000)}
    await drone.sends(TELEMETRY, sample(session, seq).model_copy(update=far))

    assert await drone.state() == "AVAILABLE"


async def test_the_provider_puts_the_drone_back_where_it_says_it_is(
    drone: WatchedDrone, clock: ManualClock
) -> None:
    await drone.says(position=east(20_000), soc=0.5)
    await drone.says(position=east(20_000), soc=0.5)
    assert await drone.state() == "MAINTENANCE"

    await drone.call("PATCH", {"state": "AVAILABLE"})
    await drone.says(position=east(20_000), soc=0.5)
    assert await drone.state() == "AVAILABLE"

    await drone.says(position=HOME, soc=0.5)
    assert await drone.state() == "MAINTENANCE"


@dataclass
class FakeComposition:
    """Composition, to which alarms are posted."""

    is_away: bool = False
    posted: list[tuple[str, str, str]] = field(default_factory=list)

    def of(self, network_id: str | None) -> "FakeComposition":
        assert network_id == "texas"
        return self

    async def call(self, method: str, path: str, *, body: Any) -> None:
        if self.is_away:
            raise ServiceUnavailable("composition", "away")
        self.posted.append((method, path, body.code))


@pytest.mark.databases("sqlite", "postgresql")
async def test_the_alarm_waits_for_composition(drone: WatchedDrone) -> None:
    composition = FakeComposition(is_away=True)
    announcer = AlarmAnnouncer(drone.db, composition)  # type: ignore[arg-type]
    await drone.says(position=east(20_000), soc=0.5)

    with pytest.raises(ServiceUnavailable):
        await announcer.step()
    composition.is_away = False
    for _ in range(2):
        await announcer.step()

    assert composition.posted == [("POST", DRONE_ALARMS, "DRONE_JUMPED")]
