"""After a renewal of credentials, the numbers of earlier messages are forgotten everywhere."""

import hashlib
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.fleets import announce_renewals
from skyway_provider_registry.fleets.announce_renewals import RenewalAnnouncer
from skyway_provider_registry.presence.follow import Recorder
from skyway_verifier.registry.rules import RULES

from skyway.contracts.drones import Renewals
from skyway.contracts.topics import CONNECTION, STATE
from skyway.ids import NetworkId
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules

GATEWAY = "service:gateway"
MOST = 2**53 - 1


@dataclass
class Composition:
    """Composition, as the registry notifies it."""

    is_away: bool = False
    notified: list[str] = field(default_factory=list)

    async def __call__(self, renewals: Renewals, network_id: NetworkId | None) -> None:
        if self.is_away:
            raise ServiceUnavailable("composition", "away")
        assert network_id == "texas"
        self.notified += [each.drone_id for each in renewals.renewals]


@dataclass
class StolenDrone:
    """A drone of which somebody else has the credentials."""

    api: Any
    db: Database
    clock: ManualClock
    drone: Any

    @property
    def path(self) -> str:
        return f"/v1/providers/{self.drone['provider_id']}/drones/{self.drone['drone_id']}"

    async def receives(self, topic: Any, message: Any, *, retained: bool = False) -> None:
        ids = (self.drone["provider_id"], self.drone["drone_id"])
        received = Received(topic, ids, message, retained)
        await Recorder(self.db, self.clock).record([received])

    async def shown(self) -> Any:
        return (await self.api("operator:op", "GET", self.path)).json()

    async def renew(self, how: str, composition: Composition) -> None:
        owner = f"provider:{self.drone['provider_id']}"
        if how == "revoked":
            await self.api(owner, "DELETE", f"{self.path}/credentials")
        else:
            token = (await self.api(owner, "POST", f"{self.path}/enrolment-tokens")).json()
            body = {"enrolment_token": token["enrolment_token"]}
            await self.api(GATEWAY, "POST", "/v1/enrolments", body)
        self.clock.advance(timedelta(seconds=3))
        await RenewalAnnouncer(self.db, self.clock, composition).step()


@pytest.fixture
async def stolen(api: Any, db: Database, clock: ManualClock) -> StolenDrone:
    return StolenDrone(api, db, clock, await api.drone(await api.provider()))


@pytest.mark.parametrize("how", ["revoked", "enrolled"])
async def test_the_drone_is_shown_where_it_says_it_is(
    stolen: StolenDrone, state: Any, online: Any, how: str
) -> None:
    composition = Composition()
    await stolen.receives(CONNECTION, online(MOST, MOST, "LOST"))
    await stolen.receives(STATE, state(MOST, MOST, station_id="austin"))
    await stolen.receives(STATE, state(7, 1))
    assert (await stolen.shown())["station_id"] == "austin"

    await stolen.renew(how, composition)
    await stolen.receives(CONNECTION, online(7, 2))
    await stolen.receives(STATE, state(7, 2, soc=0.5))

    shown = await stolen.shown()
    assert (shown["station_id"], shown["soc"], shown["state"]) == ("san-marcos", 0.5, "AVAILABLE")
    assert composition.notified == [stolen.drone["drone_id"]]
    assert await broken_rules(stolen.db, RULES) == []


async def test_what_the_broker_kept_from_before_does_not_count(
    stolen: StolenDrone, state: Any, clock: ManualClock
) -> None:
    clock.advance(timedelta(seconds=20))
    kept = state(MOST, MOST, station_id="austin")
    later = state(MOST, MOST, station_id="austin", sent_at=clock.now() + timedelta(days=1))
    clock.advance(timedelta(seconds=-20))
    await stolen.renew("revoked", Composition())
    await stolen.receives(STATE, state(7, 1))

    await stolen.receives(STATE, kept, retained=True)
    await stolen.receives(STATE, later, retained=True)
    assert (await stolen.shown())["station_id"] == "san-marcos"

    clock.advance(timedelta(minutes=1))
    await stolen.receives(STATE, state(7, 2, soc=0.4), retained=True)
    assert (await stolen.shown())["soc"] == 0.4


async def test_composition_is_notified_when_it_is_back_and_only_once(
    stolen: StolenDrone, clock: ManualClock, db: Database
) -> None:
    composition = Composition(is_away=True)
    announcer = RenewalAnnouncer(db, clock, composition)
    with pytest.raises(ServiceUnavailable):
        await stolen.renew("revoked", composition)
    composition.is_away = False

    for _ in range(2):
        await announcer.step()

    assert composition.notified == [stolen.drone["drone_id"]]


async def test_a_rotated_key_is_a_renewal_when_it_is_first_used(
    api: Any, stolen: StolenDrone, clock: ManualClock, db: Database
) -> None:
    composition = Composition()
    await stolen.renew("enrolled", composition)
    drone_id = stolen.drone["drone_id"]
    rotated = (await api(f"drone:{drone_id}", "POST", "/v1/enrolments/rotations")).json()
    clock.advance(timedelta(minutes=1))
    announcer = RenewalAnnouncer(db, clock, composition)

    await announcer.step()
    assert composition.notified == [drone_id]
    key_hash = hashlib.sha256(rotated["key"].encode()).hexdigest()
    await api(None, "POST", "/internal/drone-keys", {"key_hash": key_hash})
    await announcer.step()
    assert composition.notified == [drone_id]
    clock.advance(timedelta(seconds=3))
    await announcer.step()

    assert composition.notified == [drone_id, drone_id]


@pytest.mark.parametrize("most", [1, 200])
async def test_a_silent_cell_delays_only_the_renewals_of_its_own_drones(
    api: Any,
    db: Database,
    clock: ManualClock,
    stations: Any,
    monkeypatch: pytest.MonkeyPatch,
    most: int,
) -> None:
    monkeypatch.setattr(announce_renewals, "_MOST_AT_ONCE", most)
    stations.elsewhere = {"mcqueeney": "ohio"}
    provider_id = await api.provider()
    drones = [
        await api.drone(provider_id, home_station_id=home) for home in ("san-marcos", "mcqueeney")
    ]
    for drone in drones:
        path = f"/v1/providers/{provider_id}/drones/{drone['drone_id']}/credentials"
        await api(f"provider:{provider_id}", "DELETE", path)
        clock.advance(timedelta(seconds=1))
    clock.advance(timedelta(seconds=3))
    silent = {"texas"}
    notified: list[str] = []

    async def announce(renewals: Renewals, network_id: NetworkId | None) -> None:
        if network_id in silent:
            raise ServiceUnavailable(f"the cell {network_id}", "away")
        notified.extend(each.drone_id for each in renewals.renewals)

    with pytest.raises(ServiceUnavailable, match="texas"):
        await RenewalAnnouncer(db, clock, announce).step()
    assert notified == [drones[1]["drone_id"]]
    silent.clear()
    await RenewalAnnouncer(db, clock, announce).step()
    assert notified == [drones[1]["drone_id"], drones[0]["drone_id"]]
