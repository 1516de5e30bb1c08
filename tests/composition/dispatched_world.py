"""A dispatcher of a busy world, whose searches run in the test's own process."""

import asyncio
import itertools
import types
from collections.abc import Coroutine, Generator, Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any, Final

from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share_views import missions_seen, owner_of
from skyway_composition.missions.queue.dispatching.adopt import BetterOrder
from skyway_composition.missions.queue.dispatching.dispatch import (
    Dispatcher,
    DispatchTerms,
    OrderFinder,
)
from skyway_composition.missions.queue.dispatching.plan_orders import ENERGY_S_PER_KWH
from skyway_composition.missions.queue.dispatching.search_process import (
    FoundOrder,
    Search,
    SearchFailed,
    SearchProcess,
    answer,
)
from skyway_composition.networks.change_weather import WeatherChanges
from skyway_composition.networks.prepared import PreparedNetworks

from skyway.contracts.candidate import CANDIDATE_LISTS, CandidateQueries
from skyway.contracts.drones import (
    EXCHANGING,
    OUT_OF_SERVICE,
    ExchangingProviders,
    OutOfServiceAnswer,
)
from skyway.contracts.mission import PackageEta
from skyway.contracts.shortlist import CandidateLists, Candidates, Shortlist
from skyway.contracts.weather import ForecastDocument
from skyway.delivery.offer import Price, Tariff
from skyway.ids import DeliveryId, MissionId, PackageId, ProviderId
from skyway.json_model import JsonModel
from skyway.network.network import Network
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import Wake
from tests.composition.busy_network import NETWORK_ID
from tests.composition.busy_world import BusyWorld
from tests.composition.flown_drone import FlownDrone

#: The provider of all drones of a busy world.
PROVIDER: Final = ProviderId("prv_1")


class OwnSearch(SearchProcess):
    """Searches in this process, with the same number of rounds each time."""

    async def find(self, search: Search, network: Network) -> FoundOrder:
        found = answer(search, network, rounds=3)
        if isinstance(found, str):
            raise SearchFailed(found)
        return found


async def forecast_wind(world: BusyWorld, *, speed_mps: float, from_deg: float) -> None:
    """Give the network a forecast of this wind for the next day."""
    now = world.clock.now()
    wind = {"wind_speed_mps": speed_mps, "wind_from_deg": from_deg}
    reports = [
        {"station_id": station, "valid_at": (now + timedelta(hours=hour)).isoformat(), **wind}
        for station in "abc"
        for hour in range(24)
    ]
    forecast = {"source": "test", "issued_at": now.isoformat(), "reports": reports}
    networks = PreparedNetworks(world.db, world.clock)
    changes = WeatherChanges(world.db, networks, world.closings.impact, world.clock, Wake())
    await changes.put(NETWORK_ID, ForecastDocument.model_validate(forecast))


class RegistryInService:
    """A registry whose drones are in service, except the withdrawn ones; some may be due.

    Providers with a tariff exchange deliveries. The candidates of each request are the `able`
    drones of the providers that it admits. If `able` is None, there is no answer about candidates.
    """

    def __init__(
        self,
        withdrawn: frozenset[str] = frozenset(),
        due: frozenset[str] = frozenset(),
        tariffs: Mapping[str, Tariff] = types.MappingProxyType({}),
        able: Sequence[FlownDrone] | None = (),
        loading: str = "AUTOMATIC",
    ) -> None:
        self.withdrawn, self.due, self.able, self.loading = withdrawn, due, able, loading
        self.tariffs = {ProviderId(name): each for name, each in tariffs.items()}
        self.asked: list[CandidateQueries] = []

    async def call(self, _method: str, path: str, *, body: Any = None, **_: Any) -> JsonModel:
        if path == EXCHANGING:
            return ExchangingProviders(tariffs={**self.tariffs})
        if path == CANDIDATE_LISTS:
            return self._candidates(body)
        assert path == OUT_OF_SERVICE
        return OutOfServiceAnswer(
            drone_ids=tuple(each for each in body.drone_ids if each in self.withdrawn),
            due_drone_ids=tuple(each for each in body.drone_ids if each in self.due),
        )

    def _candidates(self, asked: CandidateQueries) -> CandidateLists:
        self.asked.append(asked)
        if self.able is None:
            raise ServiceUnavailable("registry", "it is away in this test")
        candidates = [each.candidate(loading=self.loading) for each in self.able]
        admitted = [
            [each for each in candidates if query.providers.admits(each.provider_id)]
            for query in asked.queries
        ]
        return CandidateLists(
            answers=tuple(
                Candidates(shortlist=Shortlist.of(each), infeasible=()) for each in admitted
            )
        )


def dispatcher_of(
    world: BusyWorld,
    *,
    tolerance_s: float = 60.0,
    withdrawn: frozenset[str] = frozenset(),
    due: frozenset[str] = frozenset(),
    search: SearchProcess | None = None,
    registry: RegistryInService | None = None,
) -> Dispatcher:
    """A dispatcher on the world's database."""
    finder = OrderFinder(
        world.context,
        OwnSearch() if search is None else search,
        registry or RegistryInService(withdrawn, due),  # type: ignore[arg-type]
        DispatchTerms(every_s=10.0, budget_s=0.05, tolerance_s=tolerance_s),
    )
    return Dispatcher(world.context, finder)


async def look(world: BusyWorld, dispatcher: Dispatcher) -> list[str]:
    """Look at all fleets as the dispatcher does, once; the outcomes."""
    found = [await dispatcher.look_at(*each) for each in await dispatcher.finder.fleets()]
    await world.check()
    return found


#: An order that never stops changing would change more often than this.
_MOST_CHANGES: Final = 5


async def dispatch_fairly(world: BusyWorld, *, tolerance_s: float = 60.0) -> list[str]:
    """Run the dispatcher until nothing changes; check each change, and return the outcomes."""
    dispatcher, outcomes = dispatcher_of(world, tolerance_s=tolerance_s), []
    for _ in range(_MOST_CHANGES):
        before = await waiting_missions(world)
        outcome = await dispatcher.look_at(NETWORK_ID, PROVIDER)
        after = await waiting_missions(world)
        outcomes.append(str(outcome))
        if outcome != "adopted":
            assert after == before
            return outcomes
        await world.check()
        _check_gain(before, after, tolerance_s=tolerance_s)
    raise AssertionError(f"the order changes again and again: {outcomes}")


async def waiting_missions(world: BusyWorld) -> dict[MissionId, MissionRecord]:
    """The QUEUED missions by their ids."""
    return {
        each.mission_id: each for each in await world.planned() if each.mission.state == "QUEUED"
    }


def _check_gain(
    before: Mapping[MissionId, MissionRecord],
    after: Mapping[MissionId, MissionRecord],
    *,
    tolerance_s: float,
) -> None:
    """Check that time and energy are saved together, no promise is broken, and no price changes.

    A mission may have become a guest of another one; then its delivery still sees it.
    """
    assert _prices(after) == _prices(before)
    earlier, later = _arrivals(before.values()), _arrivals(after.values())
    saved_j = _energy_j(before.values()) - _energy_j(after.values())
    saved_s = sum(_ends_s(earlier)) - sum(_ends_s(later))
    assert saved_s + ENERGY_S_PER_KWH * saved_j / 3.6e6 > 0
    promised = _promised(before.values())
    assert _promised(after.values()) == promised
    allowed_s = _allowed(before.values())
    for each, eta_at in later.items():
        allowed = timedelta(seconds=max(tolerance_s, allowed_s[each]))
        latest_at = max(earlier[each], promised.get(each, earlier[each]) + allowed)
        assert eta_at <= latest_at


def _energy_j(records: Iterable[MissionRecord]) -> float:
    """The energy of all flights until the last hand-overs."""
    return sum(each.mission.plan.energy_j or 0.0 for each in records)


def _prices(records: Mapping[MissionId, MissionRecord]) -> dict[MissionId, Price]:
    """The price of each mission that a delivery sees."""
    seen = [each for record in records.values() for each in missions_seen(record)]
    return {each.mission_id: each.price for each in seen}


def _arrivals(records: Iterable[MissionRecord]) -> dict[tuple[DeliveryId, PackageId], datetime]:
    """When each package arrives, by its delivery and its customer's id."""
    return {
        owner_of(record, each.package_id): each.eta_at
        for record in records
        for each in record.mission.packages
    }


def _promised(records: Iterable[MissionRecord]) -> dict[tuple[DeliveryId, PackageId], datetime]:
    """When each package was promised."""
    return {
        owner_of(record, each.package_id): each.eta_at
        for record in records
        for each in record.promised
    }


def _allowed(records: Iterable[MissionRecord]) -> dict[tuple[DeliveryId, PackageId], float]:
    """How much later its customer lets each package come, seconds; a shared mission may not."""

    def later_s(record: MissionRecord, eta: PackageEta) -> float:
        if record.shares:
            return 0.0
        kept_at = record.request.kept_until(eta.package_id, eta.eta_at)
        return (kept_at - eta.eta_at).total_seconds()

    return {
        owner_of(record, each.package_id): later_s(record, each)
        for record in records
        for each in record.promises.values()
    }


def _ends_s(arrivals: Mapping[tuple[DeliveryId, PackageId], datetime]) -> Iterable[float]:
    """When the last package of each delivery arrives."""
    ends: dict[DeliveryId, float] = {}
    for (delivery_id, _), eta_at in arrivals.items():
        ends[delivery_id] = max(ends.get(delivery_id, 0.0), eta_at.timestamp())
    return ends.values()


@types.coroutine
def until_wait(step: Coroutine[Any, Any, object], wait: int) -> Generator[Any, Any, str]:
    """Run a step and kill it in its n-th wait; its clean-up may wait, too."""
    for number in itertools.count(1):
        try:
            awaited = (
                step.throw(asyncio.CancelledError()) if number == wait + 1 else step.send(None)
            )
        except StopIteration as done:
            return str(done.value)
        yield awaited
    raise AssertionError


async def adopt_after_kills(world: BusyWorld, dispatcher: Dispatcher, better: BetterOrder) -> None:
    """Adopt an order; before that, kill the adoption in every third wait, which changes nothing."""
    before = await waiting_missions(world)
    outcome, wait = None, 0
    while outcome is None:
        wait += 3
        try:
            outcome = await until_wait(dispatcher.adopt(better), wait)
        except asyncio.CancelledError:
            assert await waiting_missions(world) == before
    assert outcome == "adopted"
    assert wait > 30, "the adoption was hardly ever killed inside"
    await world.check()


async def better_order(dispatcher: Dispatcher) -> BetterOrder:
    """The better order that the dispatcher finds, not adopted yet."""
    found = await dispatcher.finder.find(NETWORK_ID, PROVIDER)
    assert isinstance(found, BetterOrder)
    return found
