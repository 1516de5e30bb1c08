"""A whole gateway on a new database, with a fake registry and a fake composition."""

import json
from base64 import b64encode
from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from ipaddress import ip_network
from pathlib import Path
from typing import Any, Final

import httpx
from pydantic import AnyHttpUrl, TypeAdapter, ValidationError
from skyway_gateway.access.api_key import ApiKey, KeyRole
from skyway_gateway.access.store import add as add_key
from skyway_gateway.app import gateway_app, take_over
from skyway_gateway.build_parts import build_parts
from skyway_gateway.deliveries.records.delivery_rows import StoredDelivery, changing, package_values
from skyway_gateway.deliveries.records.delivery_store import lock
from skyway_gateway.delivery_tables import deliveries
from skyway_gateway.parts import Parts
from skyway_gateway.settings import GatewaySettings
from skyway_gateway.tables import events
from skyway_verifier.gateway.rules import RULES
from sqlalchemy import select, text

from skyway.contracts.delivery_event_forms import AnyDeliveryEvent
from skyway.contracts.mission_reports import (
    MANY_MISSION_REPORTS,
    MissionReport,
    MissionReports,
    TracedReport,
)
from skyway.ids import DeliveryId, KeyId, SubjectId
from skyway.runtime.clock import AnchoredClock, ManualClock
from skyway.runtime.errors import RowRefused
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceIdentity
from skyway.runtime.peer_secrets import secret_hash
from tests.broken_rules import broken_rules
from tests.gateway.fake_composition import STATIONS, FakeComposition
from tests.gateway.peers import FakeRegistry, Forwarded, Peers
from tests.shared_app import shared_app

START = datetime(2026, 3, 1, 12, tzinfo=UTC)

SECRETS = (
    "service_gateway",
    "service_composition",
    "service_registry",
    "mqtt_gateway",
    "mqtt_operator",
    "operator_key",
    "customer_key",
)

VAULT_KEY = b64encode(bytes(32)).decode()


@dataclass
class Gateway:
    """A gateway whose loops a test steps by hand."""

    parts: Parts
    http: httpx.AsyncClient
    clock: ManualClock
    registry: FakeRegistry
    composition: FakeComposition
    forwarded: list[Forwarded]
    peers: Peers
    secrets_dir: Path
    #: Set by a test that breaks an invariant on purpose.
    is_damaged: bool = False
    #: Whether its database is checked when the test ends.
    is_checked: bool = True

    #: The headers of each caller.
    customer: dict[str, str] = field(default_factory=dict)
    other: dict[str, str] = field(default_factory=dict)
    provider: dict[str, str] = field(default_factory=dict)
    operator: dict[str, str] = field(default_factory=dict)
    drone: dict[str, str] = field(default_factory=dict)

    async def post(self, body: object, **headers: str) -> httpx.Response:
        """POST /v1/deliveries as the customer."""
        return await self.http.post(
            "/v1/deliveries", json=body, headers={**self.customer, **headers}
        )

    async def accepted(self, *, packages: int = 1, **changes: Any) -> DeliveryId:
        """The id of a delivery that was just accepted."""
        answer = await self.post(make_request(packages=packages, **changes))
        assert answer.status_code == 202, answer.text
        return DeliveryId(answer.json()["delivery_id"])

    async def book_next(self) -> bool:
        """Book the delivery that is due first; False when none is."""
        due = await self.parts.booker.claim(limit=1)
        for queued in due:
            await self.parts.booker.book_or_retry(queued)
        return bool(due)

    async def planned(self, *, packages: int = 1) -> DeliveryId:
        """The id of a delivery that was just booked."""
        delivery_id = await self.accepted(packages=packages)
        while await self.book_next():
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
        self,
        delivery_id: str,
        kind: str,
        *,
        seq: int,
        attempt: int = 1,
        trip: int = 1,
        **fields: Any,
    ) -> httpx.Response:
        """POST a mission report as composition does."""
        report = self.mission_report(
            delivery_id, kind, seq=seq, attempt=attempt, trip=trip, **fields
        )
        headers = ServiceIdentity("composition", self.secrets_dir).headers(None)
        return await self.http.post(
            "/internal/mission-reports",
            content=report.model_dump_json(),
            headers={**headers, "content-type": "application/json"},
        )

    async def report_together(self, *reports: MissionReport) -> httpx.Response:
        """POST several mission reports in one request."""
        together = MissionReports(reports=tuple(TracedReport(report=each) for each in reports))
        headers = ServiceIdentity("composition", self.secrets_dir).headers(None)
        return await self.http.post(
            MANY_MISSION_REPORTS,
            content=together.model_dump_json(),
            headers={**headers, "content-type": "application/json"},
        )

    def mission_report(
        self,
        delivery_id: str,
        kind: str,
        *,
        seq: int,
        attempt: int = 1,
        trip: int = 1,
        **fields: Any,
    ) -> MissionReport:
        """A mission report as composition makes it."""
        mission = self.composition.trips_of(delivery_id, attempt)[trip - 1]
        states = {"ACCEPTED": "ACCEPTED", "REFUSED": "REFUSED", "ENDED": "COMPLETED"}
        return MissionReport.model_validate(
            {
                "report_id": f"rpt_{attempt}_{trip}_{seq}",
                "delivery_id": delivery_id,
                "attempt": attempt,
                "trip": trip,
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

    async def event_types(self, delivery_id: str) -> list[str]:
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
        """Change the database without the gateway."""
        async with self.parts.db.write() as tx:
            await tx.execute(text(statement), values)

    async def undocumented_events(self) -> list[str]:
        """The events whose JSON is not of the form that customers' documents show."""
        async with self.parts.db.read() as connection:
            bodies = (await connection.execute(select(events.c.body))).scalars().all()
        return [body for body in bodies if not _is_documented(body)]

    async def wrongly_cached(self) -> list[str]:
        """Deliveries whose cached state differs from the stored state."""
        cache = self.parts.writer.cache
        async with self.parts.db.write() as tx:
            written = {
                delivery_id: await lock(tx, delivery_id)
                for delivery_id in (await tx.execute(select(deliveries.c.delivery_id))).scalars()
            }
        return [
            delivery_id
            for delivery_id, now in written.items()
            if (known := cache.matching([(delivery_id, now.version)]).get(delivery_id))
            and _writable(known) != _writable(now)
        ]

    async def verified(self) -> list[str]:
        """The rules that are broken."""
        return [rule for rule, _ in await self.broken()]

    async def broken(self) -> list[tuple[str, str]]:
        """The rules that are broken, with the subjects that break them.

        The keys of `_make_callers` were made without a call.
        """
        found = await broken_rules(
            self.parts.db, RULES, wall_at=self.clock.wall_now(), fleet_at=self.clock.now()
        )
        return [each for each in found if each[1] not in _MADE_BY_HAND]


def make_request(
    *, packages: int = 1, window: Mapping[str, str] | None = None, **changes: Any
) -> dict[str, Any]:
    """A request for packages to stations in turn, all with this window."""
    stations = STATIONS[1:4]
    return {
        "pickup": {"station_id": "san-marcos"},
        "packages": [
            {
                "package_id": f"p{number}",
                "mass_kg": 0.5,
                "destination": {"station_id": stations[(number - 1) % 3]},
                **(window or {}),
            }
            for number in range(1, packages + 1)
        ],
        "qos": {"objective": "FASTEST"},
        **changes,
    }


@asynccontextmanager
async def opened_gateway(
    database_url: str, folder: Path, **settings_given: Any
) -> AsyncIterator[Gateway]:
    """A gateway that is open, but whose loops do not run. Any: each setting has its own type."""
    secrets_dir = folder / "secrets"
    secrets_dir.mkdir(exist_ok=True)
    for name in SECRETS:
        (secrets_dir / name).write_text(f"{name}-0123456789abcdef\n")
    (secrets_dir / "tracking_key").write_text("a key of tracking links\n")
    (secrets_dir / "webhook_keys").write_text(f"{VAULT_KEY}\n")
    settings = GatewaySettings(
        database_url=database_url,
        mqtt_url="mqtt://127.0.0.1:1",
        secrets_dir=secrets_dir,
        webhook_allow_networks=(ip_network("127.0.0.0/8"),),
        public_url=AnyHttpUrl("http://gateway"),
        **{"proof_store": f"file://{folder}/photos", **settings_given},
    )
    clock = ManualClock(START)
    around = Peers(FakeRegistry(), FakeComposition(clock))
    identity = ServiceIdentity("gateway", secrets_dir)
    clients = {
        name: ServiceClient(name, f"http://{name}", identity, transport=around.transport(name))
        for name in ("registry", "composition")
    }
    anchor = AnchoredClock(fleet_at=START, wall_at=START, rate=1.0)
    parts = build_parts(settings, clients=clients, anchor=anchor, clock=clock)
    # However slow the machine is, work costs no budget. Parts are frozen: only a test replaces one.
    object.__setattr__(parts, "entrance", replace(parts.entrance, now=lambda: 0.0))
    async with AsyncExitStack() as opened:
        await opened.enter_async_context(parts.db)
        await take_over(parts)
        await opened.enter_async_context(clients["registry"])
        await opened.enter_async_context(parts.servers)
        await opened.enter_async_context(parts.post)
        transport = httpx.ASGITransport(shared_app(gateway_app, parts))
        http = httpx.AsyncClient(transport=transport, base_url="http://gateway")
        await opened.enter_async_context(http)
        gateway = Gateway(
            parts,
            http,
            clock,
            around.registry,
            around.composition,
            around.seen,
            around,
            secrets_dir,
        )
        await _make_callers(gateway)
        commits = parts.db.commits
        yield gateway
        # On PostgreSQL commits are not counted.
        is_unchanged = parts.db.dialect == "sqlite" and parts.db.commits == commits
        if gateway.is_checked and not (gateway.is_damaged or is_unchanged):
            assert await gateway.broken() == []
            assert await gateway.wrongly_cached() == []
            assert await gateway.undocumented_events() == []


_EVENT: TypeAdapter[AnyDeliveryEvent] = TypeAdapter(AnyDeliveryEvent)


def _is_documented(body: str) -> bool:
    try:
        _EVENT.validate_json(body, extra="forbid")
    except ValidationError:
        return False
    return True


def _writable(known: StoredDelivery) -> object:
    """Everything that a write stores of a delivery; moments are stored in milliseconds."""
    delivery = known.delivery
    return (
        changing(known),
        [package_values(package) for package in delivery.packages],
        delivery.model_dump(exclude={"created_at", "updated_at", "packages"}),
    )


_CALLERS: Final[dict[str, tuple[KeyRole, str]]] = {
    "customer": ("customer", "alice"),
    "other": ("customer", "bob"),
    "provider": ("provider", "prv_1"),
    "operator": ("operator", "op"),
}
_MADE_BY_HAND: Final = frozenset(f"key_{name}" for name in _CALLERS)


async def _make_callers(gateway: Gateway) -> None:
    for name in _CALLERS:
        setattr(gateway, name, {"Authorization": f"Bearer sk_{name}"})
    # An earlier gateway on the same database has made them already.
    with suppress(RowRefused):
        async with gateway.parts.db.write() as tx:
            for name, (role, subject_id) in _CALLERS.items():
                key = ApiKey(
                    key_id=KeyId(f"key_{name}"),
                    role=role,
                    subject_id=SubjectId(subject_id),
                    created_wall_at=START,
                )
                secret = secret_hash(f"sk_{name}")
                await add_key(tx, key, key_hash=secret, is_account_open=True)
    gateway.registry.drone_keys[secret_hash("dk_drone")] = "drn_1"
    gateway.drone = {"Authorization": "Bearer dk_drone"}
