"""A look at many fleets rests before each of them, and no fleet keeps the others from theirs."""

from typing import Any

import pytest
from skyway_composition.missions.queue.dispatching.dispatch import Dispatcher
from skyway_composition.missions.queue.dispatching.search_process import SearchProcess


class Finder:
    """Finds no order for two fleets; the search of the fleets in `failing` fails."""

    def __init__(self, *failing: str) -> None:
        self.failing = failing
        self.seen: list[str] = []

    @property
    def search(self) -> SearchProcess:
        self.seen.append("rest")
        return SearchProcess()

    async def fleets(self) -> list[tuple[str, str]]:
        return [("net", "prv_1"), ("net", "prv_2")]

    async def find(self, _network_id: str, provider_id: str) -> str:
        self.seen.append(provider_id)
        if provider_id in self.failing:
            raise ValueError(provider_id)
        return "unsearched"


def dispatcher(finder: Any) -> Dispatcher:
    anything: Any = None
    return Dispatcher(anything, finder)


async def test_a_look_at_many_fleets_rests_before_each_of_them() -> None:
    finder = Finder()

    await dispatcher(finder).step()

    assert finder.seen == ["rest", "prv_1", "rest", "prv_2"]


async def test_a_fleet_whose_search_fails_does_not_stop_the_others() -> None:
    finder = Finder("prv_1")

    with pytest.raises(ExceptionGroup, match="fleets not dispatched"):
        await dispatcher(finder).step()

    assert finder.seen[-1] == "prv_2"
