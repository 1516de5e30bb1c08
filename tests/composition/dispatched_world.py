"""A dispatcher of a busy world, whose searches run in the test's own process."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any, Final

from skyway_composition.missions.calendar.dispatching.dispatch import Dispatcher
from skyway_composition.missions.calendar.dispatching.find_order import DispatchTerms, OrderFinder
from skyway_composition.missions.calendar.dispatching.search_process import (
    FoundOrder,
    Search,
    SearchFailed,
    SearchProcess,
    answer,
)
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.networks.prepared import PreparedNetworks

from skyway.contracts.drones import OutOfServiceAnswer, OutOfServiceQuery
from skyway.ids import MissionId, ProviderId
from skyway.network.network import Network
from skyway.runtime.loops import Wake
from tests.composition.busy_network import NETWORK_ID
from tests.composition.busy_world import BusyWorld

#: The provider of all drones of a busy world.
PROVIDER: Final = ProviderId("prv_1")


class OwnSearch(SearchProcess):
    """Searches in this process, with the same number of rounds each time."""

    async def find(self, search: Search, network: Network) -> FoundOrder:
        found = answer(search, network, rounds=3)
        if isinstance(found, str):
            raise SearchFailed(found)
        return found


class RegistryInService:
    """A registry whose drones are in service, except the withdrawn ones; some may be due."""

    def __init__(
        self, withdrawn: frozenset[str] = frozenset(), due: frozenset[str] = frozenset()
    ) -> None:
        self.withdrawn, self.due = withdrawn, due

    async def call(
        self, _method: str, _path: str, *, body: OutOfServiceQuery, **_: Any
    ) -> OutOfServiceAnswer:
        return OutOfServiceAnswer(
            drone_ids=tuple(each for each in body.drone_ids if each in self.withdrawn),
            due_drone_ids=tuple(each for each in body.drone_ids if each in self.due),
        )


def dispatcher_of(
    world: BusyWorld,
    *,
    tolerance_s: float = 60.0,
    withdrawn: frozenset[str] = frozenset(),
    due: frozenset[str] = frozenset(),
    search: SearchProcess | None = None,
) -> Dispatcher:
    """A dispatcher on the world's database."""
    finder = OrderFinder(
        world.db,
        PreparedNetworks(world.db),
        world.solver,
        OwnSearch() if search is None else search,
        RegistryInService(withdrawn, due),  # type: ignore[arg-type]
        world.clock,
        DispatchTerms(every_s=10.0, budget_s=0.05, tolerance_s=tolerance_s),
    )
    return Dispatcher(world.db, finder, world.clock, world.mint, Wake())


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
    """Check that all missions together end sooner, no promise is broken, and no price changes."""
    assert after.keys() == before.keys()
    assert sum(each.served_ms for each in after.values()) < sum(
        each.served_ms for each in before.values()
    )
    for mission_id, record in after.items():
        earlier = before[mission_id]
        latest_at = {each.package_id: each.eta_at for each in earlier.mission.packages}
        for each in earlier.promised:
            promised_at = each.eta_at + timedelta(seconds=tolerance_s)
            latest_at[each.package_id] = max(latest_at[each.package_id], promised_at)
        assert all(each.eta_at <= latest_at[each.package_id] for each in record.mission.packages)
        assert record.mission.price == earlier.mission.price
        assert record.promised == earlier.promised
