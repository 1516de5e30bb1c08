"""A whole registry on a new database, called as the gateway calls it."""

from collections.abc import AsyncIterator, Callable, Iterable
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Literal

import httpx
import pytest
from skyway_provider_registry.app import registry_app
from skyway_provider_registry.enrolment.password_file import PasswordFile
from skyway_provider_registry.fleets.issue_credentials import Issuer
from skyway_provider_registry.fleets.quota_store import DroneLimit
from skyway_provider_registry.parts import Parts
from skyway_provider_registry.presence.judge_states import NoQuarantine
from skyway_provider_registry.tables import replicas

from skyway.announced_networks import NetworkLearner
from skyway.broker_setup.mosquitto_accounts import MosquittoAccounts
from skyway.cells import CellClients
from skyway.contracts.drone_report import Connection, DroneState, Telemetry
from skyway.contracts.station_check import NetworkFacts, NetworkStations, StationCheck
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceGate, ServiceIdentity
from skyway.runtime.http.metrics_routes import MetricsGate
from skyway.runtime.mqtt.signature_check import SignatureCheck
from skyway.runtime.replicas.membership import Membership
from skyway.runtime.replicas.replica_store import ReplicaStore
from skyway.runtime.signing.cloud_key_file import CLOUD_KEYS, CloudKeyFile
from skyway.runtime.sql.database import Database
from tests.counting_mint import CountingMint
from tests.shared_app import shared_app
from tests.signing_files import write_cloud_keys
from tests.unsigned_drones import unsigned_book

STATIONS = {
    StationId("san-marcos"): Position(-97.94139, 29.88327),
    StationId("mcqueeney"): Position(-98.03334, 29.59217),
}
#: Beside these, another network around the same place.
NETWORKS = {
    NetworkId("texas"): tuple(STATIONS),
    NetworkId("city"): (StationId("c-s1"), StationId("c-s2")),
}


@dataclass
class KnownStations:
    """Composition that knows two stations, or is away; and two networks."""

    is_away: bool = False
    asked: list[tuple[StationId, ...]] = field(default_factory=list)
    #: The stations that are not in the network texas, with their networks.
    elsewhere: dict[str, str] = field(default_factory=dict)
    #: The stations that no segment leaves, and what drones meet in networks.
    isolated: tuple[StationId, ...] = ()
    networks: dict[NetworkId, NetworkFacts] = field(default_factory=dict)

    async def check(self, station_ids: Iterable[StationId]) -> StationCheck:
        asked = tuple(dict.fromkeys(station_ids))
        self.asked.append(asked)
        if self.is_away:
            raise ServiceUnavailable("composition", "it cannot be reached")
        known = {one: STATIONS[one] for one in asked if one in STATIONS}
        return StationCheck(
            network_ids={one: NetworkId(self.elsewhere.get(one, "texas")) for one in known},
            positions=known,
            unknown=tuple(one for one in asked if one not in STATIONS),
            isolated=self.isolated,
            networks=self.networks,
        )

    async def all_stations(self, network_id: NetworkId) -> NetworkStations:
        station_ids = NETWORKS[network_id]
        return NetworkStations(
            network_id=network_id,
            version=1,
            station_ids=station_ids,
            positions=(STATIONS[StationId("san-marcos")],) * len(station_ids),
            parts=(0,) * len(station_ids),
        )


@dataclass
class Api:
    """The registry over HTTP, as the gateway or `service` calls it; it speaks for `caller`."""

    client: httpx.AsyncClient

    async def __call__(
        self,
        caller: str | None,
        method: str,
        path: str,
        json: Any = None,
        key: str | None = None,
        service: str | None = None,
    ) -> httpx.Response:
        headers = {} if caller is None else {"Skyway-Caller": caller}
        if service is not None:
            headers["Authorization"] = f"Bearer secret of service_{service}"
        if key is not None:
            headers["Idempotency-Key"] = key
        return await self.client.request(method, path, json=json, headers=headers)

    async def provider(self, **members: object) -> str:
        """The id of a new provider."""
        body = {"name": "Hill Country Drones", "tariff": {"base": 300}, **members}
        answer = await self("operator:op", "POST", "/v1/providers", body)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["provider_id"])

    async def drone(self, provider_id: str, **members: object) -> Any:
        """A new drone, as its registration answers."""
        body = {"model_id": "paper-scenario", "home_station_id": "san-marcos", **members}
        path = f"/v1/providers/{provider_id}/drones"
        answer = await self(f"provider:{provider_id}", "POST", path, body)
        assert answer.status_code == 201, answer.text
        return answer.json()


@pytest.fixture
def secrets_dir(tmp_path: Path) -> Path:
    folder = tmp_path / "secrets"
    folder.mkdir()
    for name in ("service_gateway", "service_composition", "service_registry"):
        (folder / name).write_text(f"secret of {name}\n")
    for name in ("gateway", "registry", "composition", "operator"):
        (folder / f"mqtt_{name}").write_text(f"mqtt password of {name}\n")
    write_cloud_keys(folder)
    return folder


@pytest.fixture
def package() -> str:
    """Whose tables `migrated_url` has."""
    return "skyway_provider_registry"


@pytest.fixture
async def db(migrated_url: str) -> AsyncIterator[Database]:
    """The registry's database, with its tables."""
    async with Database(migrated_url) as opened:
        yield opened


@pytest.fixture
def stations() -> KnownStations:
    return KnownStations()


@pytest.fixture
def networks(stations: KnownStations) -> NetworkLearner:
    return NetworkLearner(stations.all_stations)


@pytest.fixture
def password_file(db: Database, secrets_dir: Path, tmp_path: Path) -> PasswordFile:
    return PasswordFile(
        MosquittoAccounts(tmp_path / "passwords"),
        db=db,
        secrets_dir=secrets_dir,
        broker_pid_file=None,
    )


@pytest.fixture
async def servers(secrets_dir: Path) -> AsyncIterator[CellClients]:
    """The servers of composition: that of texas is away, and that of ohio takes everything."""

    def answer(request: httpx.Request) -> httpx.Response:
        if request.url.host == "north":
            raise httpx.ConnectError("no such server")
        return httpx.Response(204)

    default = ServiceClient(
        "composition",
        "http://composition",
        ServiceIdentity("registry", secrets_dir),
        transport=httpx.MockTransport(answer),
    )
    cells = {NetworkId("texas"): "http://north", NetworkId("ohio"): "http://south"}
    async with CellClients(default, cells) as opened:
        yield opened


@pytest.fixture
async def api(
    db: Database,
    clock: ManualClock,
    secrets_dir: Path,
    stations: KnownStations,
    networks: NetworkLearner,
    password_file: PasswordFile,
    servers: CellClients,
) -> AsyncIterator[Api]:
    parts = Parts(
        db=db,
        membership=Membership(ReplicaStore(db, replicas), own_id="only", clock=clock),
        gate=ServiceGate(secrets_dir, allowed=("gateway", "composition")),
        metrics_gate=MetricsGate(secrets_dir),
        clock=clock,
        mint=CountingMint(),
        stations=stations,
        networks=networks,
        password_file=password_file,
        issuer=Issuer(
            None,
            CloudKeyFile(secrets_dir / CLOUD_KEYS),
            password_file.hash_password,
            mqtt_urls=("mqtt://one:1883", "mqtt://two:1883"),
        ),
        cloud_keys=CloudKeyFile(secrets_dir / CLOUD_KEYS),
        signatures=SignatureCheck(unsigned_book(clock), NoQuarantine()),
        drone_limit=DroneLimit(db, 1_800),
        servers=servers,
    )

    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(shared_app(registry_app, parts)),
        base_url="http://registry",
        headers={"Authorization": "Bearer secret of service_gateway"},
    ) as client:
        yield Api(client)


@pytest.fixture
def online(clock: ManualClock) -> Callable[..., Connection]:
    def make(
        session: int,
        connection_number: int,
        status: Literal["ONLINE", "OFFLINE", "LOST"] = "ONLINE",
    ) -> Connection:
        return Connection(
            message_id="m",
            sent_at=clock.now(),
            session=session,
            connection_number=connection_number,
            status=status,
        )

    return make


@pytest.fixture
def state(clock: ManualClock) -> Callable[..., DroneState]:
    def make(session: int, seq: int, **members: Any) -> DroneState:
        return DroneState.model_validate(
            {
                "message_id": "m",
                "sent_at": clock.now(),
                "session": session,
                "seq": seq,
                "at": clock.now(),
                "activity": "IDLE",
                "stream": 0,
                "last_instruction_seq": 0,
                "last_event_seq": 0,
                "station_id": "san-marcos",
                "position": Position(-97.9, 29.9),
                "soc": 0.9,
                **members,
            }
        )

    return make


@pytest.fixture
def sample(clock: ManualClock) -> Callable[..., Telemetry]:
    def make(session: int, seq: int, *, later_s: float = 0.0, soc: float = 0.5) -> Telemetry:
        at: datetime = clock.now() + timedelta(seconds=later_s)
        return Telemetry(
            message_id="m",
            sent_at=at,
            session=session,
            seq=seq,
            at=at,
            position=Position(-98.0, 29.5),
            soc=soc,
            power_w=600.0,
            speed_mps=23.0,
        )

    return make
