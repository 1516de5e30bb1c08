"""The parts of the registry; nothing is opened here."""

import asyncio
import secrets
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from skyway.announced_networks import NetworkLearner, stations_from
from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.mosquitto_accounts import MosquittoAccounts
from skyway.broker_setup.nats_accounts import NatsAccounts
from skyway.cells import CellClients
from skyway.runtime.clock import FleetClock, load_clock
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceGate, ServiceIdentity
from skyway.runtime.http.metrics_routes import MetricsGate
from skyway.runtime.loops import Pace
from skyway.runtime.metrics import Gauges
from skyway.runtime.minting import Mint, mint
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.connection import Login, MqttConnection
from skyway.runtime.mqtt.signature_check import SignatureCheck
from skyway.runtime.peer_secrets import read_secret
from skyway.runtime.replicas.membership import Membership
from skyway.runtime.replicas.replica_store import ReplicaStore
from skyway.runtime.signing.cloud_key_file import CLOUD_KEYS, CloudKeyFile
from skyway.runtime.signing.key_book import KeyBook
from skyway.runtime.sql.database import Database
from skyway_provider_registry.candidates.fleet_view import FleetView
from skyway_provider_registry.enrolment.password_file import PasswordFile
from skyway_provider_registry.enrolment.signing_store import StoredKeys
from skyway_provider_registry.fleets.issue_credentials import Issuer
from skyway_provider_registry.fleets.quota_store import DroneLimit
from skyway_provider_registry.homes import CompositionStations, StationLookup
from skyway_provider_registry.presence.judge_states import NoQuarantine
from skyway_provider_registry.settings import RegistrySettings
from skyway_provider_registry.tables import OPEN_ROWS, replicas

SERVICE: Final = "registry"

#: Seconds of wall time between two reads of the changes. Under load several callers share one;
#: after a pause no caller waits.
_REFRESH_EVERY_S: Final = 0.1

#: The most wall seconds for ending a drone's connection.
_TAKE_OVER_S: Final = 5.0


@dataclass(frozen=True, slots=True)
class Parts:
    """The things that the routes need."""

    db: Database
    membership: Membership
    gate: ServiceGate
    metrics_gate: MetricsGate
    clock: FleetClock
    mint: Mint
    stations: StationLookup
    networks: NetworkLearner
    password_file: PasswordFile
    issuer: Issuer
    cloud_keys: CloudKeyFile
    signatures: SignatureCheck
    drone_limit: DroneLimit
    servers: CellClients
    gauges: Gauges = field(default_factory=Gauges)

    @property
    def fleet_view(self) -> FleetView:
        """Keeps all fleets in memory for the selection of candidates."""
        return FleetView(self.db, self.networks.cached, Pace(_REFRESH_EVERY_S))


def composition_client(settings: RegistrySettings) -> ServiceClient:
    """The client that asks composition about stations and networks."""
    identity = ServiceIdentity(SERVICE, settings.secrets_dir)
    return ServiceClient("composition", settings.composition_url, identity)


def parts_in_life(settings: RegistrySettings) -> Parts:
    """The parts with the files of these settings and the system's clock."""
    db, clock = Database(settings.database_url), load_clock(settings.clock_file)
    cloud_keys = CloudKeyFile(settings.secrets_dir / CLOUD_KEYS)
    servers = CellClients(composition_client(settings), settings.cells)
    authority = None
    if settings.drone_ca_dir is not None:
        authority = CertificateAuthority.load(settings.drone_ca_dir)
    accounts_file = settings.broker_password_file
    is_nats = settings.broker_kind == "nats"
    password_file = PasswordFile(
        NatsAccounts(accounts_file) if is_nats else MosquittoAccounts(accounts_file, authority),
        db=db,
        secrets_dir=settings.secrets_dir,
        broker_pid_file=settings.broker_pid_file,
        end_connection=None if is_nats or authority is None else partial(take_over, settings),
    )
    own_id = f"{SERVICE}-{secrets.token_hex(8)}"
    membership = Membership(
        ReplicaStore(db, replicas, open_rows=OPEN_ROWS), own_id=own_id, clock=clock
    )
    return Parts(
        db=db,
        membership=membership,
        gate=ServiceGate(settings.secrets_dir, allowed=("gateway", "composition")),
        metrics_gate=MetricsGate(settings.secrets_dir),
        clock=clock,
        mint=mint,
        stations=CompositionStations(servers),
        networks=NetworkLearner(stations_from(servers.of)),
        password_file=password_file,
        issuer=Issuer(
            authority, cloud_keys, password_file.hash_password, mqtt_urls=settings.mqtt_drone_url
        ),
        cloud_keys=cloud_keys,
        signatures=SignatureCheck(
            KeyBook(StoredKeys(db, clock), clock), NoQuarantine(membership.owns)
        ),
        drone_limit=DroneLimit(db, settings.drones_per_provider),
        servers=servers,
    )


async def take_over(settings: RegistrySettings, account: str) -> None:
    """End the connection of a drone: Mosquitto does that when its client id connects again.

    A service may choose its client id, and a drone's is its user name.
    """
    login = Login(account, SERVICE, read_secret(settings.secrets_dir, f"mqtt_{SERVICE}"), 10)
    link = MqttConnection(login, will=None, on_message=lambda *_: None)
    try:
        async with asyncio.timeout(_TAKE_OVER_S):
            await link.open(BrokerAddress.parse(settings.mqtt_url), settings.mqtt_tls)
    finally:
        link.close()
