"""A whole gateway on a new database, with a registry and a composition that tests instruct."""

import json
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from ipaddress import ip_network
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI, Request, Response
from skyway_gateway.access.key import ApiKey, secret_hash
from skyway_gateway.access.store import add as add_key
from skyway_gateway.app import Parts, build_parts, gateway_app, take_over
from skyway_gateway.settings import GatewaySettings
from skyway_gateway.verify import violations
from sqlalchemy import text

from skyway.contracts.candidate import (
    Candidate,
    CandidateQuery,
    Candidates,
    PayloadLimit,
    PayloadLimitQuery,
    ProviderReason,
)
from skyway.contracts.mission import (
    Booking,
    BookMissions,
    ClosedDelivery,
    Mission,
    MissionReport,
    PackageEta,
)
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.delivery.offer import Price, Tariff
from skyway.delivery.plan import PackageDelivery, Plan, PlanStatus
from skyway.delivery.request import DeliveryRequest
from skyway.drone.models import PAPER_SCENARIO
from skyway.geo import Position
from skyway.json_model import JsonModel
from skyway.runtime.clock import AnchoredClock, ManualClock
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http import ServiceClient
from skyway.runtime.identity import ServiceIdentity
from skyway.runtime.migrations import migrate
from skyway.runtime.problems import problem_of, problem_response

START = datetime(2026, 3, 1, 12, tzinfo=UTC)

#: Stations of the fake network; "island" is known, but no path leads there.
STATIONS = ("san-marcos", "mcqueeney", "bulverde", "san-antonio", "island")

SECRETS = (
    "service_gateway",
    "service_composition",
    "service_registry",
    "mqtt_gateway",
    "mqtt_operator",
    "operator_key",
    "customer_key",
)


def make_candidate(drone_id: str = "drn_1", provider_id: str = "prv_1") -> Candidate:
    return Candidate(
        provider_id=provider_id,
        drone_id=drone_id,
        model=PAPER_SCENARIO,
        soc=1.0,
        station_id="san-marcos",
        home_station_id="san-marcos",
        tariff=Tariff(base=500),
    )


def make_reason(code: str, *, is_temporary: bool, provider_id: str = "prv_1") -> ProviderReason:
    return ProviderReason(
        provider_id=provider_id, code=code, detail=f"why {code}", is_temporary=is_temporary
    )


def make_mission(
    request: DeliveryRequest,
    *,
    delivery_id: str,
    attempt: int,
    drone_id: str,
    start_at: datetime,
    provider_id: str = "prv_1",
) -> Mission:
    """One package every ten minutes, from the start on."""
    deliveries = [
        (package.package_id, package.destination.station_id, 600.0 * number)
        for number, package in enumerate(request.packages, start=1)
    ]
    last_s = deliveries[-1][2]
    return Mission(
        mission_id=f"msn_{delivery_id[4:]}_{attempt}",
        delivery_id=delivery_id,
        attempt=attempt,
        provider_id=provider_id,
        drone_id=drone_id,
        drone_model_id=PAPER_SCENARIO.model_id,
        state="BOOKED",
        revision=1,
        start_at=start_at,
        released_at=start_at + timedelta(seconds=2 * last_s),
        price=Price(amount=1234, currency="USD"),
        packages=tuple(
            PackageEta(package_id=package_id, eta_at=start_at + timedelta(seconds=at_s))
            for package_id, _, at_s in deliveries
        ),
        plan=Plan(
            status=PlanStatus.OPTIMAL,
            delivery_time_s=last_s,
            energy_j=1e6,
            flight_s=last_s,
            waiting_s=0.0,
            recharging_s=0.0,
            deliveries=tuple(
                PackageDelivery(package_id=package_id, station_id=station_id, delivered_s=at_s)
                for package_id, station_id, at_s in deliveries
            ),
        ),
    )


@dataclass
class FakeRegistry:
    """Answers what a test says; `is_away` makes it unreachable."""

    candidates_now: list[Candidate] = field(default_factory=lambda: [make_candidate()])
    infeasible: list[ProviderReason] = field(default_factory=list)
    limit: PayloadLimit = field(
        default_factory=lambda: PayloadLimit(
            max_payload_kg=5.0, drone_model_id="lifter", unknown_provider_ids=()
        )
    )
    is_away: bool = False
    queries: list[CandidateQuery] = field(default_factory=list)
    accounts: dict[str, str] = field(default_factory=dict)

    async def candidates(self, query: CandidateQuery) -> Candidates:
        self._answer()
        self.queries.append(query)
        free = [c for c in self.candidates_now if c.drone_id not in query.excluded_drone_ids]
        return Candidates(candidates=tuple(free), infeasible=tuple(self.infeasible))

    async def payload_limit(self, query: PayloadLimitQuery) -> PayloadLimit:
        self._answer()
        return self.limit

    async def open_account(self, user_name: str, *, password: str) -> None:
        self._answer()
        self.accounts[user_name] = password

    async def close_account(self, user_name: str) -> None:
        self._answer()
        self.accounts.pop(user_name, None)

    def _answer(self) -> None:
        if self.is_away:
            raise ServiceUnavailable("registry", "it is away in this test")


@dataclass
class FakeComposition:
    """Books like the real one: once per (delivery, attempt), and nothing after the tombstone."""

    clock: ManualClock
    is_away: bool = False
    is_busy: bool = False
    reasons: list[ProviderReason] = field(default_factory=list)
    booked: dict[tuple[str, int], Mission] = field(default_factory=dict)
    closed: set[str] = field(default_factory=set)
    #: How often something was booked anew, which must be once per attempt.
    booking_count: int = 0

    async def check_stations(self, query: StationCheckQuery) -> StationCheck:
        self._answer()
        known = [one for one in query.station_ids if one in STATIONS]
        return StationCheck(
            network_ids=dict.fromkeys(known, "corridor"),
            positions={one: Position(-98.0, 29.0 + STATIONS.index(one)) for one in known},
            unknown=tuple(one for one in query.station_ids if one not in STATIONS),
            unreachable=tuple(one for one in known if one == "island"),
        )

    async def book(self, delivery_id: str, wanted: BookMissions) -> Booking:
        self._answer()
        if (delivery_id, wanted.attempt) in self.booked:
            mission = self.booked[delivery_id, wanted.attempt]
            return Booking(outcome="BOOKED", missions=(mission,))
        if delivery_id in self.closed:
            return Booking(outcome="CLOSED")
        if self.is_busy or not wanted.candidates:
            return Booking(outcome="BUSY", reasons=tuple(self.reasons))
        if self.reasons:
            return Booking(outcome="INFEASIBLE", reasons=tuple(self.reasons))
        mission = make_mission(
            wanted.request,
            delivery_id=delivery_id,
            attempt=wanted.attempt,
            drone_id=wanted.candidates[0].drone_id,
            start_at=self.clock.now() + timedelta(seconds=60),
            provider_id=wanted.candidates[0].provider_id,
        )
        self.booking_count += 1
        self.booked[delivery_id, wanted.attempt] = mission
        return Booking(outcome="BOOKED", missions=(mission,))

    async def close(self, delivery_id: str) -> ClosedDelivery:
        self._answer()
        live = tuple(
            mission
            for (booked_id, _), mission in self.booked.items()
            if booked_id == delivery_id and mission.state == "BOOKED"
        )
        if live and delivery_id not in self.closed:
            return ClosedDelivery(is_closed=False, missions=live)
        self.closed.add(delivery_id)
        return ClosedDelivery(is_closed=True)

    def _answer(self) -> None:
        if self.is_away:
            raise ServiceUnavailable("composition", "it is away in this test")


@dataclass
class Forwarded:
    """A request as it reached another service."""

    service: str
    method: str
    path: str
    query: str
    headers: dict[str, str]
    body: bytes


def fake_services(
    registry: FakeRegistry, composition: FakeComposition, seen: list[Forwarded]
) -> dict[str, FastAPI]:
    """The fakes over HTTP; whatever they do not know is noted in `seen` and answered 200."""

    async def answer(act: Any) -> Response:
        try:
            found = await act
        except (ServiceUnavailable, RemoteProblem) as error:
            return problem_response(problem_of(error))
        body = found.model_dump_json() if isinstance(found, JsonModel) else "null"
        return Response(body, media_type="application/json")

    def make_app(service: str) -> FastAPI:
        app = FastAPI()

        @app.api_route("/{path:path}", methods=["GET", "POST", "PUT", "PATCH", "DELETE"])
        async def anything(path: str, request: Request) -> Response:
            body = await request.body()
            headers = dict(request.headers)
            seen.append(Forwarded(service, request.method, path, request.url.query, headers, body))
            if request.method == "POST" and path == "v1/providers":
                made = {"provider_id": "prv_new", **json.loads(body)}
                return Response(json.dumps(made), 201, media_type="application/json")
            return Response(b'{"seen": true}', headers={"ETag": '"1-abc"'})

        return app

    apps = {"registry": make_app("registry"), "composition": make_app("composition")}
    calls: dict[str, tuple[FastAPI, str, Callable[[Request], Any]]] = {
        "/internal/candidates": (
            apps["registry"],
            "POST",
            lambda raw: registry.candidates(CandidateQuery.read(raw)),
        ),
        "/internal/payload-limit": (
            apps["registry"],
            "POST",
            lambda raw: registry.payload_limit(PayloadLimitQuery.read(raw)),
        ),
        "/internal/station-checks": (
            apps["composition"],
            "POST",
            lambda raw: composition.check_stations(StationCheckQuery.read(raw)),
        ),
    }
    for path, (app, method, act) in calls.items():

        def add(app: FastAPI, path: str, method: str, act: Any) -> None:
            async def call(request: Request) -> Response:
                return await answer(act(await request.body()))

            app.router.routes.insert(0, _route(path, call, method))

        add(app, path, method, act)

    async def put_account(request: Request) -> Response:
        password = json.loads(await request.body())["password"]
        name = request.path_params["user_name"]
        return await answer(registry.open_account(name, password=password))

    async def delete_account(request: Request) -> Response:
        return await answer(registry.close_account(request.path_params["user_name"]))

    async def put_missions(request: Request) -> Response:
        wanted = BookMissions.read(await request.body())
        return await answer(composition.book(request.path_params["delivery_id"], wanted))

    async def put_closed(request: Request) -> Response:
        return await answer(composition.close(request.path_params["delivery_id"]))

    account = "/internal/broker-accounts/{user_name}"
    delivery = "/internal/deliveries/{delivery_id}"
    apps["registry"].router.routes.insert(0, _route(account, put_account, "PUT"))
    apps["registry"].router.routes.insert(0, _route(account, delete_account, "DELETE"))
    apps["composition"].router.routes.insert(0, _route(f"{delivery}/missions", put_missions, "PUT"))
    apps["composition"].router.routes.insert(0, _route(f"{delivery}/closed", put_closed, "PUT"))
    return apps


def _route(path: str, call: Any, method: str) -> Any:
    from starlette.routing import Route

    return Route(path, call, methods=[method])


@dataclass
class Gateway:
    """A gateway whose loops a test steps by hand."""

    parts: Parts
    http: httpx.AsyncClient
    clock: ManualClock
    registry: FakeRegistry
    composition: FakeComposition
    forwarded: list[Forwarded]
    secrets_dir: Path
    #: Set by a test that breaks an invariant on purpose.
    is_damaged: bool = False

    #: The headers of each caller.
    customer: dict[str, str] = field(default_factory=dict)
    other: dict[str, str] = field(default_factory=dict)
    provider: dict[str, str] = field(default_factory=dict)
    operator: dict[str, str] = field(default_factory=dict)

    async def post(self, body: object, **headers: str) -> httpx.Response:
        """POST /v1/deliveries as the customer."""
        return await self.http.post(
            "/v1/deliveries", json=body, headers={**self.customer, **headers}
        )

    async def accepted(self, *, packages: int = 1, **changes: object) -> str:
        """The id of a delivery that was just accepted."""
        answer = await self.post(make_request(packages=packages, **changes))
        assert answer.status_code == 202, answer.text
        return str(answer.json()["delivery_id"])

    async def planned(self, *, packages: int = 1) -> str:
        """The id of a delivery that was just booked."""
        delivery_id = await self.accepted(packages=packages)
        while await self.parts.booker.step():
            pass
        assert (await self.get(delivery_id))["state"] == "PLANNED"
        return delivery_id

    async def get(self, delivery_id: str) -> dict[str, Any]:
        """The delivery as its customer sees it."""
        answer = await self.http.get(f"/v1/deliveries/{delivery_id}", headers=self.customer)
        assert answer.status_code == 200, answer.text
        found: dict[str, Any] = answer.json()
        return found

    async def report(
        self, delivery_id: str, kind: str, *, seq: int, attempt: int = 1, **fields: object
    ) -> httpx.Response:
        """POST a mission report as composition does."""
        mission = self.composition.booked[delivery_id, attempt]
        states = {"ACCEPTED": "ACCEPTED", "REFUSED": "REFUSED", "ENDED": "COMPLETED"}
        report = MissionReport.model_validate(
            {
                "report_id": f"rpt_{attempt}_{seq}",
                "delivery_id": delivery_id,
                "attempt": attempt,
                "trip": 1,
                "mission_id": mission.mission_id,
                "provider_id": mission.provider_id,
                "drone_id": mission.drone_id,
                "seq": seq,
                "kind": kind,
                "at": self.clock.now(),
                "mission_state": states.get(kind, "ACTIVE"),
                **fields,
            }
        )
        headers = ServiceIdentity("composition", self.secrets_dir).headers(None)
        return await self.http.post(
            "/internal/mission-reports",
            content=report.model_dump_json(),
            headers={**headers, "content-type": "application/json"},
        )

    async def told(self, delivery_id: str) -> list[str]:
        """The types of a delivery's events, whose sequence has no gap."""
        return [event["type"] for event in await self.events(delivery_id)]

    async def events(self, delivery_id: str) -> list[dict[str, Any]]:
        """A delivery's events."""
        statement = text("SELECT sequence, body FROM events WHERE delivery_id = :id ORDER BY 1")
        async with self.parts.db.read() as connection:
            rows = (await connection.execute(statement, {"id": delivery_id})).all()
        assert [row.sequence for row in rows] == list(range(1, len(rows) + 1))
        return [json.loads(row.body) for row in rows]

    async def execute(self, statement: str, **values: object) -> None:
        """Change the database behind the gateway's back."""
        async with self.parts.db.write() as tx:
            await tx.execute(text(statement), values)

    async def verified(self) -> list[str]:
        """The rules that are broken."""
        return [violation["rule"] for violation in await violations(self.parts.db)]


def make_request(*, packages: int = 1, **changes: object) -> dict[str, Any]:
    """A request for packages to stations in turn."""
    stations = STATIONS[1:4]
    return {
        "pickup": {"station_id": "san-marcos"},
        "packages": [
            {
                "package_id": f"p{number}",
                "mass_kg": 0.5,
                "destination": {"station_id": stations[(number - 1) % 3]},
            }
            for number in range(1, packages + 1)
        ],
        "qos": {"objective": "fastest"},
        **changes,
    }


@asynccontextmanager
async def opened_gateway(database_url: str, folder: Path) -> AsyncIterator[Gateway]:
    """A gateway that is open, but whose loops do not run."""
    secrets_dir = folder / "secrets"
    secrets_dir.mkdir()
    for name in SECRETS:
        (secrets_dir / name).write_text(f"{name}-0123456789abcdef\n")
    settings = GatewaySettings(
        database_url=database_url,
        mqtt_url="mqtt://127.0.0.1:1",
        secrets_dir=secrets_dir,
        webhook_allow_networks=(ip_network("127.0.0.0/8"),),
    )
    clock = ManualClock(START)
    registry, composition = FakeRegistry(), FakeComposition(clock)
    forwarded: list[Forwarded] = []
    identity = ServiceIdentity("gateway", secrets_dir)
    clients = {
        name: ServiceClient(name, f"http://{name}", identity, transport=httpx.ASGITransport(app))
        for name, app in fake_services(registry, composition, forwarded).items()
    }
    anchor = AnchoredClock(fleet_at=START, wall_at=START, rate=1.0)
    parts = build_parts(settings, clients=clients, anchor=anchor, clock=clock)
    app = gateway_app(parts, lifespan=_no_lifespan, readiness=_no_parts)
    async with AsyncExitStack() as opened:
        await opened.enter_async_context(parts.db)
        await take_over(parts)
        for client in clients.values():
            await opened.enter_async_context(client)
        await opened.enter_async_context(parts.post)
        http = httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://gateway")
        await opened.enter_async_context(http)
        gateway = Gateway(parts, http, clock, registry, composition, forwarded, secrets_dir)
        await _make_callers(gateway)
        yield gateway
        if not gateway.is_damaged:
            assert await gateway.verified() == []


@asynccontextmanager
async def _no_lifespan(_app: FastAPI) -> AsyncIterator[None]:
    yield


async def _no_parts() -> dict[str, bool]:
    return {}


async def _make_callers(gateway: Gateway) -> None:
    callers = {
        "customer": ("customer", "alice"),
        "other": ("customer", "bob"),
        "provider": ("provider", "prv_1"),
        "operator": ("operator", "op"),
    }
    async with gateway.parts.db.write() as tx:
        for name, (role, subject_id) in callers.items():
            key = ApiKey(key_id=f"key_{name}", role=role, subject_id=subject_id, created_at=START)
            secret = f"sk_{name}"
            await add_key(tx, key, key_hash=secret_hash(secret), is_account_open=True)
            setattr(gateway, name, {"Authorization": f"Bearer {secret}"})


@pytest.fixture(scope="session")
def migrated_sqlite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A migrated SQLite file to copy: migrating anew for every test takes longer than it."""
    import asyncio

    path = tmp_path_factory.mktemp("gateway") / "empty.db"
    asyncio.run(migrate(f"sqlite:///{path}", "skyway_gateway"))
    return path


@pytest.fixture
async def gateway(migrated_sqlite: Path, tmp_path: Path) -> AsyncIterator[Gateway]:
    """A gateway on SQLite; what its invariants forbid fails the test at its end."""
    path = tmp_path / "gateway.db"
    shutil.copy(migrated_sqlite, path)
    async with opened_gateway(f"sqlite:///{path}", tmp_path) as opened:
        yield opened


@pytest.fixture
async def gateway_on_both(database_url: str, tmp_path: Path) -> AsyncIterator[Gateway]:
    """The same, once on SQLite and once on PostgreSQL."""
    await migrate(database_url, "skyway_gateway")
    async with opened_gateway(database_url, tmp_path) as opened:
        yield opened


@pytest.fixture
def request_body() -> Callable[..., dict[str, Any]]:
    """Makes the JSON of a delivery request."""
    return make_request


@pytest.fixture
def reason() -> Callable[..., ProviderReason]:
    """Makes a provider's reason."""
    return make_reason


@pytest.fixture
def candidate() -> Callable[..., Candidate]:
    """Makes a candidate."""
    return make_candidate


@pytest.fixture
def mission() -> Callable[..., Mission]:
    """Makes a mission."""
    return make_mission
