"""The process that searches: it answers, is replaced when it dies, and ends with its owner."""

import asyncio
import os
import pickle

import pytest
from skyway_composition.missions.queue.dispatching.search_process import (
    _LENGTH,
    _MOST_SHARE,
    Search,
    SearchFailed,
    SearchProcess,
    answer,
)

from skyway.dispatch.problem import FleetDrone, FleetRequest
from skyway.ids import NetworkId
from skyway.planner.warm import MODEL, STATIONS, line_network

_FIRST, _MIDDLE, _LAST = STATIONS


TWO_REQUESTS = tuple(
    FleetRequest.model_validate(
        {
            "request_id": request_id,
            "source": source,
            "packages": [{"package_id": request_id, "mass_kg": 0.3, "destination": to}],
        }
    )
    for request_id, source, to in (("msn_1", _FIRST, _LAST), ("msn_2", _MIDDLE, _FIRST))
)


def make_search(*, budget_s: float = 0.01, **fields: object) -> Search:
    packages = [{"package_id": "p", "mass_kg": 0.3, "destination": _LAST}]
    return Search(
        NetworkId("line"),
        1,
        {
            "drones": (
                FleetDrone.model_validate(
                    {"drone_id": "d", "model": MODEL, "station_id": _MIDDLE, "soc": 1.0}
                ),
            ),
            "requests": (
                FleetRequest.model_validate(
                    {"request_id": "msn_1", "source": _FIRST, "packages": packages}
                ),
            ),
            **fields,
        },
        budget_s,
        1,
    )


async def test_the_process_answers_dies_and_is_replaced() -> None:
    network, search = line_network(), make_search()
    expected = answer(search, network, rounds=1)
    assert not isinstance(expected, str)
    async with SearchProcess() as process:
        first = await process.find(search, network)
        assert first.orders == expected.orders == {"d": ("msn_1",)}
        assert first.is_complete

        with pytest.raises(SearchFailed, match="0 drones"):
            await process.find(make_search(drones=()), network)

        running = process._process
        assert running is not None
        running.kill()
        with pytest.raises(SearchFailed, match="has ended"):
            await process.find(search, network)
        assert (await process.find(search, network)).orders == expected.orders
        last = process._process
    assert last is not None
    assert last.returncode is not None


@pytest.mark.long
async def test_searches_leave_the_processors_to_others() -> None:
    now_s = 100.0
    network, search = line_network(), make_search()
    async with SearchProcess(now=lambda: now_s) as process:
        assert process.rest_s == 0.0
        first, second = [await process.find(search, network) for _ in range(2)]
    allowed = _MOST_SHARE * (os.cpu_count() or 1)
    assert process.rest_s == pytest.approx((first.processor_s + second.processor_s) / allowed)
    now_s += process.rest_s + 1.0
    assert process.rest_s == 0.0


@pytest.mark.long
async def test_a_process_in_the_middle_of_a_search_ends_with_its_owner() -> None:
    """An owner that was killed closes nothing itself: the system closes its end of the pipe."""
    long_search = make_search(budget_s=3_600.0, requests=TWO_REQUESTS)
    async with SearchProcess() as process:
        await process.find(make_search(), line_network())
        running = process._process
        assert running is not None
        assert running.stdin is not None
        text = pickle.dumps((long_search, None))
        running.stdin.write(_LENGTH.pack(len(text)) + text)
        await running.stdin.drain()

        running.stdin.close()

        assert await asyncio.wait_for(running.wait(), timeout=60) == 0


@pytest.mark.long
async def test_the_first_search_of_a_new_process_has_its_whole_budget() -> None:
    """The later request lies on the drone's way to the earlier one, which only a round finds."""
    async with SearchProcess() as process:
        found = await process.find(make_search(budget_s=1.0, requests=TWO_REQUESTS), line_network())

    assert found.orders == {"d": ("msn_2", "msn_1")}
