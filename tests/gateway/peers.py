"""A fake registry and composition that the gateway reaches over HTTP."""

import asyncio
import json
import re
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

import httpx

from skyway.contracts.candidate import (
    Candidate,
    CandidateQueries,
    CandidateQuery,
    PayloadLimit,
    PayloadLimitQuery,
    ProviderReason,
)
from skyway.contracts.drones import DroneKeyAnswer, DroneKeyQuery, DroneQuota
from skyway.contracts.forgotten_deliveries import FORGOTTEN_PATH, ForgetDeliveries
from skyway.contracts.mission import (
    BookMissions,
    CancelMissions,
    WithdrawMissions,
)
from skyway.contracts.quote import KeepOffer, QuoteQuery
from skyway.contracts.shortlist import CandidateLists, Candidates, Shortlist
from skyway.contracts.station_check import StationCheckQuery
from skyway.delivery.offer import Tariff
from skyway.drone.models import PAPER_SCENARIO
from skyway.json_model import JsonModel
from skyway.runtime.errors import Conflict, ServiceUnavailable
from tests.gateway.fake_composition import STATIONS, FakeComposition, make_mission, make_terms

__all__ = [
    "STATIONS",
    "FakeComposition",
    "FakeRegistry",
    "Peers",
    "make_candidate",
    "make_mission",
    "make_reason",
    "make_terms",
]


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


@dataclass
class FakeRegistry:
    """A registry with answers set by a test; `is_away` makes it unreachable."""

    candidates_now: list[Candidate] = field(default_factory=lambda: [make_candidate()])
    infeasible: list[ProviderReason] = field(default_factory=list)
    limit: PayloadLimit = field(
        default_factory=lambda: PayloadLimit(
            max_payload_kg=5.0, drone_model_id="lifter", unknown_provider_ids=()
        )
    )
    is_away: bool = False
    queries: list[CandidateQuery] = field(default_factory=list)
    lists: list[CandidateQueries] = field(default_factory=list)
    accounts: dict[str, str] = field(default_factory=dict)
    drone_keys: dict[str, str] = field(default_factory=dict)

    async def candidates(self, query: CandidateQuery) -> Candidates:
        self._answer()
        self.queries.append(query)
        free = [
            each
            for each in self.candidates_now
            if each.drone_id not in query.excluded_drone_ids
            and query.providers.pinned in (None, each.provider_id)
        ]
        return Candidates(shortlist=Shortlist.of(free), infeasible=tuple(self.infeasible))

    async def candidate_lists(self, asked: CandidateQueries) -> CandidateLists:
        self.lists.append(asked)
        answers = [await self.candidates(query) for query in asked.queries]
        return CandidateLists(answers=tuple(answers))

    async def payload_limit(self, query: PayloadLimitQuery) -> PayloadLimit:
        self._answer()
        return self.limit

    async def open_account(self, user_name: str, *, password: str) -> None:
        self._answer()
        self.accounts[user_name] = password

    async def close_account(self, user_name: str) -> None:
        self._answer()
        self.accounts.pop(user_name, None)

    async def drone_quota(self, provider_id: str) -> DroneQuota:
        self._answer()
        return DroneQuota(most=20_000, used=7)

    async def drone_of(self, query: DroneKeyQuery) -> DroneKeyAnswer:
        self._answer()
        return DroneKeyAnswer(drone_id=self.drone_keys.get(query.key_hash))

    def _answer(self) -> None:
        if self.is_away:
            raise ServiceUnavailable("registry", "it is away in this test")


@dataclass
class Forwarded:
    """A request as it reached another service."""

    service: str
    method: str
    path: str
    query: str
    headers: dict[str, str]
    body: bytes
    host: str = ""


Act = Callable[[httpx.Request, str], Awaitable[JsonModel | None]]


@dataclass
class Peers:
    """Both services as transports; other calls are noted in `seen` and answered with 200.

    `cells` are further servers of composition, by their hosts.
    """

    registry: FakeRegistry
    composition: FakeComposition
    cells: dict[str, FakeComposition] = field(default_factory=dict)
    #: Hosts that do not answer, that answer 500, that never finish, and that know no id, and the
    #: lists of hosts.
    away: set[str] = field(default_factory=set)
    failing: set[str] = field(default_factory=set)
    hanging: set[str] = field(default_factory=set)
    unknown_at: set[str] = field(default_factory=set)
    pages: dict[str, object] = field(default_factory=dict)
    seen: list[Forwarded] = field(default_factory=list)

    def transport(self, service: str) -> httpx.MockTransport:
        """The transport of one service."""

        async def answer(request: httpx.Request) -> httpx.Response:
            await request.aread()
            if request.url.host in self.away:
                raise httpx.ConnectError("away")
            if request.url.host in self.failing:
                return _streamed(500, {"title": "Failed", "status": 500})
            if request.url.host in self.hanging:
                await asyncio.Event().wait()
            composition = self.cells.get(request.url.host, self.composition)
            for pattern, act in self._acts(composition):
                found = re.fullmatch(pattern, f"{service} {request.method} {request.url.path}")
                if found is not None:
                    return await _answer(act, request, found)
            return self._note(service, request)

        return httpx.MockTransport(answer)

    def _acts(self, composition: FakeComposition) -> list[tuple[str, Act]]:
        registry = self.registry
        account, operator = "/internal/broker-accounts/(.*)", "/internal/operator-accounts/(.*)"
        delivery = "/internal/deliveries/(.*)"
        return [
            (
                "registry POST /internal/candidates()",
                lambda request, _: registry.candidates(CandidateQuery.read(request.content)),
            ),
            (
                "registry POST /internal/candidate-lists()",
                lambda request, _: registry.candidate_lists(CandidateQueries.read(request.content)),
            ),
            (
                "registry POST /internal/payload-limit()",
                lambda request, _: registry.payload_limit(PayloadLimitQuery.read(request.content)),
            ),
            (
                f"registry PUT {account}",
                lambda request, name: registry.open_account(
                    name, password=json.loads(request.content)["password"]
                ),
            ),
            (
                "registry POST /internal/drone-keys()",
                lambda request, _: registry.drone_of(DroneKeyQuery.read(request.content)),
            ),
            (
                "registry GET /internal/providers/(.*)/drone-quota",
                lambda _, provider_id: registry.drone_quota(provider_id),
            ),
            (f"registry DELETE {account}", lambda _, name: registry.close_account(name)),
            (
                f"registry PUT {operator}",
                lambda request, name: registry.open_account(
                    f"operator/{name}", password=json.loads(request.content)["password"]
                ),
            ),
            (
                f"registry DELETE {operator}",
                lambda _, name: registry.close_account(f"operator/{name}"),
            ),
            (
                "composition POST /internal/station-checks()",
                lambda request, _: composition.check_stations(
                    StationCheckQuery.read(request.content)
                ),
            ),
            (
                "composition POST /internal/quotes()",
                lambda request, _: composition.quote(QuoteQuery.read(request.content)),
            ),
            (
                "composition POST /internal/offers()",
                lambda request, _: composition.keep(KeepOffer.read(request.content)),
            ),
            (
                "composition DELETE /internal/holds/([^/]+)",
                lambda _, hold_id: composition.release(hold_id),
            ),
            (
                f"composition PUT {delivery}/missions",
                lambda request, delivery_id: composition.book(
                    delivery_id, BookMissions.read(request.content)
                ),
            ),
            (
                f"composition PUT {delivery}/closed",
                lambda _, delivery_id: composition.close(delivery_id),
            ),
            (
                f"composition POST {delivery}/cancellations",
                lambda request, delivery_id: composition.cancel(
                    delivery_id, CancelMissions.read(request.content)
                ),
            ),
            (
                f"composition POST {delivery}/withdrawals",
                lambda request, delivery_id: composition.withdraw(
                    delivery_id, WithdrawMissions.read(request.content)
                ),
            ),
            (
                f"composition POST {FORGOTTEN_PATH}()",
                lambda request, _: composition.forget(ForgetDeliveries.read(request.content)),
            ),
            (
                f"composition GET {delivery}/track",
                lambda _, delivery_id: composition.track(delivery_id),
            ),
        ]

    def _note(self, service: str, request: httpx.Request) -> httpx.Response:
        self.seen.append(
            Forwarded(
                service,
                request.method,
                request.url.path,
                request.url.query.decode(),
                dict(request.headers),
                request.content,
                request.url.host,
            )
        )
        if (request.method, request.url.path) == ("POST", "/v1/providers"):
            made = {"provider_id": "prv_new", **json.loads(request.content)}
            return _streamed(201, made)
        if request.url.host in self.unknown_at:
            return _streamed(404, {"title": "Not found", "status": 404})
        return _streamed(200, self.pages.get(request.url.host, {"seen": True}))


async def _answer(act: Act, request: httpx.Request, found: re.Match[str]) -> httpx.Response:
    try:
        answer = await act(request, found[1])
    except ServiceUnavailable:
        return httpx.Response(503)
    except Conflict as conflict:
        problem = {
            "type": "urn:skyway:problem:conflict",
            "title": "Conflict",
            "status": 409,
            "code": conflict.code,
            "detail": conflict.detail,
        }
        return httpx.Response(409, json=problem)
    if answer is None:
        return httpx.Response(204)
    return httpx.Response(200, content=answer.model_dump_json())


def _streamed(status: int, value: object) -> httpx.Response:
    """A response whose body is not read yet, as it comes from a socket."""
    headers = {"content-type": "application/json", "etag": '"1-abc"'}
    return httpx.Response(
        status, headers=headers, stream=httpx.ByteStream(json.dumps(value).encode())
    )
