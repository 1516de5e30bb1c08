"""A whole composition service on a new database, and drones whose messages tests make."""

import asyncio
import itertools
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from skyway_composition.app import composition_app
from skyway_composition.links.listening import Listening
from skyway_composition.missions.following.follow import Follower, ReportHandler
from skyway_composition.missions.queue.dispatching.dispatch import DispatchTerms
from skyway_composition.missions.queue.keep_calendars import Calendars
from skyway_composition.missions.replanning.replan import Replanner
from skyway_composition.missions.timeouts import LateMissions, OverdueMissions
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.own_cells import OwnCells
from skyway_composition.parts import Parts
from skyway_composition.planning.no_show_store import NoShows
from skyway_composition.planning.routes import StrategyRights
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.quarantine.set_aside import Quarantine
from skyway_composition.tables import outbox
from skyway_verifier.composition.rules import RULES
from sqlalchemy import select, text

from skyway.contracts.candidate import Candidate
from skyway.contracts.drones import NetworkDrones
from skyway.contracts.instruction import Instruction
from skyway.contracts.mission import Booking, BookMissions
from skyway.contracts.mission_reports import MissionReport
from skyway.contracts.shortlist import Shortlist
from skyway.contracts.topics import Topic
from skyway.delivery.offer import Tariff
from skyway.delivery.request import DeliveryRequest
from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId, NetworkId
from skyway.runtime.clock import ManualClock
from skyway.runtime.http.identity import ServiceGate
from skyway.runtime.http.metrics_routes import MetricsGate
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.signature_check import SignatureCheck
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules
from tests.composition.drone_messages import DroneMessages
from tests.composition.lone_replica import lone_replica
from tests.counting_mint import CountingMint
from tests.shared_app import shared_app
from tests.unsigned_drones import unsigned_book

#: The drone of the paper's scenario must recharge after a flight of 20 km.
SCENARIO_MODEL = DRONE_MODELS[DroneModelId("paper-scenario")]

#: 20 km on the equator in degrees of longitude.
STEP_DEG = 0.17986

OPERATOR = "operator:op"
GATEWAY = "service:gateway"


def make_network(
    *, pads: dict[str, int] | None = None, stations: str = "abcde", **settings: object
) -> dict[str, Any]:
    """Stations in a row, 20 km apart, connected to their neighbours; 2 pads unless in `pads`."""
    points: list[dict[str, Any]] = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": [(ord(name) - 97) * STEP_DEG, 0.0]},
            "properties": {
                "kind": "station",
                "station_id": name,
                "pads": (pads or {}).get(name, 2),
            },
        }
        for name in stations
    ]
    lines = [
        {
            "type": "Feature",
            "geometry": {
                "type": "LineString",
                "coordinates": [
                    before["geometry"]["coordinates"],
                    after["geometry"]["coordinates"],
                ],
            },
            "properties": {
                "kind": "segment",
                "from": before["properties"]["station_id"],
                "to": after["properties"]["station_id"],
            },
        }
        for before, after in itertools.pairwise(points)
    ]
    return {"type": "FeatureCollection", "features": points + lines, "settings": settings}


def make_candidate(number: int = 1, **members: Any) -> Candidate:
    """Drone `number` of provider 1, fully charged and at home at station a."""
    values = {
        "provider_id": "prv_1",
        "drone_id": f"drn_{number}",
        "model": SCENARIO_MODEL,
        "soc": 1.0,
        "station_id": "a",
        "home_station_id": "a",
        "tariff": Tariff(base=100, per_km=10),
        **members,
    }
    return Candidate.model_validate(values)


def make_request(
    *destinations: str, mass_kg: float = 0.4, pickup: str = "a", **members: Any
) -> DeliveryRequest:
    """One package for each destination."""
    return DeliveryRequest.model_validate(
        {
            "pickup": {"station_id": pickup},
            "packages": [
                {
                    "package_id": f"p{number}",
                    "mass_kg": mass_kg,
                    "destination": {"station_id": destination},
                }
                for number, destination in enumerate(destinations, 1)
            ],
            **members,
        }
    )


@dataclass
class SilentSubscriber:
    """`Subscriber` on which nothing arrives: tests pass batches to the follower."""

    async def batches(self, *_: Topic[Any], **__: Any) -> AsyncIterator[list[Received[Any]]]:
        await asyncio.Event().wait()
        yield []


@dataclass
class Composition:
    """The service's parts and its REST API."""

    client: httpx.AsyncClient
    parts: Parts
    clock: ManualClock
    follower: Follower
    overdue: OverdueMissions
    late_missions: LateMissions
    replanner: Replanner
    listening: Listening
    calendars: Calendars
    handler: ReportHandler
    deliveries: int = field(default=0)

    @property
    def db(self) -> Database:
        return self.parts.db

    async def __call__(
        self, caller: str | None, method: str, path: str, json: Any = None, **headers: str
    ) -> httpx.Response:
        named = {} if caller is None else {"Skyway-Caller": caller}
        sent = {name.replace("_", "-"): value for name, value in headers.items()}
        return await self.client.request(method, path, json=json, headers=named | sent)

    async def publish(self, network: dict[str, Any] | None = None) -> None:
        answer = await self(OPERATOR, "PUT", "/v1/networks/row", network or make_network())
        assert answer.is_success, answer.text

    async def book(
        self,
        *candidates: Candidate,
        delivery_id: str = "dlv_1",
        attempt: int = 1,
        request: DeliveryRequest | None = None,
    ) -> Booking:
        body = BookMissions(
            attempt=attempt,
            request=request or make_request("c"),
            shortlist=Shortlist.of(candidates or [make_candidate()]),
        )
        path = f"/internal/deliveries/{delivery_id}/missions"
        answer = await self(GATEWAY, "PUT", path, body.model_dump(mode="json"))
        assert answer.status_code == 200, answer.text
        return Booking.model_validate_json(answer.content)

    async def receive(self, *batch: Received[Any]) -> None:
        await self.handler.handle(batch)

    async def sent(self, drone_id: str = "drn_1") -> list[Any]:
        """The instructions that the outbox still sends to a drone, in order."""
        rows = await self._outbox("mqtt", stream=drone_id)
        topic = _instruction_topic()
        return [topic.read(row.payload) for row in rows]

    async def reports(self, service: str = "gateway") -> list[MissionReport]:
        """The mission reports on their way to a service, in order."""
        rows = await self._outbox(service)
        return [MissionReport.model_validate_json(row.payload) for row in rows]

    async def reservations(self) -> Sequence[Any]:
        return await self.rows(
            "SELECT station_id, pad, start_ms, end_ms, mission_id FROM pad_reservations "
            "ORDER BY station_id, pad, start_ms"
        )

    async def rows(self, sql: str) -> Sequence[Any]:
        async with self.db.read() as connection:
            return (await connection.execute(text(sql))).all()

    async def state_of(self, mission_id: str) -> str:
        answer = await self(OPERATOR, "GET", f"/v1/missions/{mission_id}")
        return str(answer.json()["mission"]["state"])

    async def broken(self) -> list[tuple[str, str]]:
        # The drones of these tests report what is ahead, because fleet time stands still.
        # Replicas are seen by the database's own clock.
        wall_at = max(self.clock.wall_now(), datetime.now(UTC))
        return await broken_rules(self.db, RULES, wall_at=wall_at)

    async def _outbox(self, channel: str, stream: str | None = None) -> Sequence[Any]:
        query = select(outbox).where(outbox.c.channel == channel).order_by(outbox.c.id)
        if stream is not None:
            query = query.where(outbox.c.stream == stream)
        async with self.db.read() as connection:
            return (await connection.execute(query)).all()


def _instruction_topic() -> Topic[Any]:
    return Topic(
        "{d}", Instruction, mqtt_qos=1, retained=False, writer="composition", readers=(), about=""
    )


@pytest.fixture
def make() -> SimpleNamespace:
    """The makers of test data: make.network, make.candidate, make.request."""
    return SimpleNamespace(network=make_network, candidate=make_candidate, request=make_request)


@pytest.fixture
def secrets_dir(tmp_path: Path) -> Path:
    folder = tmp_path / "secrets"
    folder.mkdir()
    for name in ("gateway", "registry", "composition"):
        (folder / f"service_{name}").write_text(f"secret of {name}\n")
        (folder / f"mqtt_{name}").write_text(f"mqtt password of {name}\n")
    return folder


@pytest.fixture
def package() -> str:
    """The package whose tables `migrated_url` has."""
    return "skyway_composition"


@pytest.fixture
async def db(migrated_url: str) -> AsyncIterator[Database]:
    """Composition's database, with its tables."""
    async with Database(migrated_url, outbox=outbox) as opened:
        yield opened


async def no_drones(_network_id: NetworkId) -> NetworkDrones:
    """A registry without drones."""
    return NetworkDrones(models=(), unplaced=0)


@pytest.fixture
async def unpublished(
    db: Database, clock: ManualClock, secrets_dir: Path
) -> AsyncIterator[Composition]:
    """Composition without any network."""
    mint = CountingMint()
    membership = lone_replica(db, clock)
    listening = Listening(clock, membership)
    listening.begin()
    async with (
        SolverPool(threads=2, time_limit_s=5.0) as solver,
        SolverPool(threads=2, time_limit_s=600.0) as inquiries,
        SolverPool(threads=2, time_limit_s=600.0) as problems,
    ):
        own_cells = OwnCells({}, "http://ours", "http://ours")
        quarantine = Quarantine(
            db, clock=clock, mint=mint, listening=listening, is_foreign=own_cells.is_foreign
        )
        keys = unsigned_book(clock)
        parts = Parts(
            db=db,
            membership=membership,
            gate=ServiceGate(secrets_dir, allowed=("gateway", "registry")),
            metrics_gate=MetricsGate(secrets_dir),
            clock=clock,
            mint=mint,
            networks=PreparedNetworks(db, clock, own_cells),
            solver=solver,
            inquiries=inquiries,
            problems=problems,
            rights=StrategyRights.read("exact, heuristic"),
            listening=listening,
            quarantine=quarantine,
            keys=keys,
            signatures=SignatureCheck(keys, quarantine),
            no_shows=NoShows(db, clock),
            own_cells=own_cells,
            count_drones=no_drones,
            dispatch_terms=DispatchTerms(every_s=0.0, budget_s=0.1, tolerance_s=60.0),
        )
        handler = parts.handler
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(shared_app(composition_app, parts)),
            base_url="http://composition",
            headers={"Authorization": "Bearer secret of gateway"},
        ) as client:
            follower = Follower(
                handler,
                SilentSubscriber(),
                doorkeeper=parts.signatures,
                clock=clock,
                quarantine=parts.quarantine,
                listening=listening,
            )
            overdue = OverdueMissions(parts, listening)
            late = LateMissions(parts)
            replanner = Replanner(parts, "test", parts.closings)
            calendars = Calendars(parts, tolerance_s=60.0)
            whole = Composition(
                client,
                parts,
                clock,
                follower,
                overdue,
                late,
                replanner,
                listening,
                calendars,
                handler,
            )
            yield whole


@pytest.fixture
async def composition(unpublished: Composition) -> Composition:
    """Composition with its network published."""
    await unpublished.publish()
    return unpublished


@pytest.fixture
def drone(composition: Composition) -> DroneMessages:
    return DroneMessages(composition)
