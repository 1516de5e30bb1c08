"""The free windows that the kernels see are those of the pad calendar."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.exact_memory import Room, new_memory
from skyway.planner.exact_task import book_of
from skyway.planner.hierarchy import rows_of
from skyway.planner.pad_book import NO_RESERVATIONS, OPEN_MS, PadBook
from skyway.planner.pad_calendar import PadCalendar


@pytest.mark.parametrize("recharges_fully", [True, False])
@pytest.mark.parametrize("seed", range(25))
def test_windows_equal_those_of_the_calendar(
    plain: SimpleNamespace, make_network: Callable[..., Network], seed: int, recharges_fully: bool
) -> None:
    random = np.random.default_rng(seed)
    network = make_network("a-b:1 b-c:1", pads={"b": int(random.integers(0, 4))})
    books = [_book(random), _book(random).seen_from(500)]
    calendar = PadCalendar(network, books)
    memory = new_memory(1, room=Room(places=2, arcs=2, windows=64, states=2, labels=2))
    memory.row[0], memory.window_first[0] = network.row_of[StationId("b")], -1
    task = SimpleNamespace(recharges_fully=recharges_fully, start=memory.row[0])
    given, known = (book_of(book) for book in books)
    search = SimpleNamespace(
        skyway=rows_of(network), task=task, given=given, known=known, memory=memory
    )

    first = plain.pads.windows_of(search, 0)

    found = memory.window_s[first : first + memory.window_count[0]].tolist()
    expected = [[one.start_s, one.end_s] for one in calendar.free_windows(StationId("b"))]
    if [0.0, np.inf] in expected:
        # Beside a pad that is free all the time no other one counts.
        assert [0.0, np.inf] in found
    else:
        assert found == (_outermost(expected) if recharges_fully else _united(expected))


@pytest.mark.parametrize(("start", "expected_s"), [("c", [70, 1010]), ("b", [20, 70, 1000, 1010])])
def test_times_too_short_for_the_energy_of_the_way_are_no_windows(
    plain: SimpleNamespace,
    make_network: Callable[..., Network],
    start: str,
    expected_s: list[float],
) -> None:
    """A drone flies at least 1 km to b, which costs 60 s of charging at the top of the curve."""
    network = make_network("a-b:1 b-c:2", pads={"b": 1})
    row_of = network.row_of
    taken_s = np.array([[0, 20], [30, 70], [500, 1_000], [1_005, 1_010]])
    book = PadBook.of_arrays(
        station=np.full(4, row_of[StationId("b")]),
        pad=np.zeros(4, np.int64),
        start_ms=1_000 * taken_s[:, 0],
        end_ms=1_000 * taken_s[:, 1],
    )
    memory = new_memory(1, room=Room(places=2, arcs=2, windows=64, states=2, labels=2))
    memory.row[0], memory.window_first[0] = row_of[StationId("b")], -1
    task = SimpleNamespace(
        recharges_fully=True,
        compares_masks=True,
        start=row_of[StationId(start)],
        destinations=np.zeros(1, np.int32),
        j_per_m=np.array([2.0, 1.0, 1.0]),
        rounding_j=1e-6,
        start_j=10_000.0,
        curve_at=np.empty(0, np.int32),
        curve_offsets=np.array([0, 2]),
        curve_s=np.array([0.0, 600.0]),
        curve_j=np.array([0.0, 10_000.0]),
    )
    given, known = book_of(book), book_of(NO_RESERVATIONS)
    search = SimpleNamespace(
        skyway=rows_of(network), task=task, given=given, known=known, memory=memory
    )

    first = plain.pads.windows_of(search, 0)

    found = memory.window_s[first : first + memory.window_count[0], 0]
    assert found.tolist() == expected_s


def _book(random: np.random.Generator) -> PadBook:
    count = int(random.integers(0, 7))
    start_ms = random.integers(-5_000, 20_000, count)
    end_ms = start_ms + random.integers(1, 9_000, count)
    end_ms[random.random(count) < 0.1] = OPEN_MS
    return PadBook.of_arrays(
        station=random.integers(0, 3, count),
        pad=random.integers(0, 3, count),
        start_ms=start_ms,
        end_ms=end_ms,
    )


def _outermost(windows: list[list[float]]) -> list[list[float]]:
    """Without the windows that lie within another one."""
    kept: list[list[float]] = []
    for start_s, end_s in sorted(windows, key=lambda one: (one[0], -one[1])):
        if not kept or end_s > kept[-1][1]:
            kept.append([start_s, end_s])
    return kept


def _united(windows: list[list[float]]) -> list[list[float]]:
    united: list[list[float]] = []
    for start_s, end_s in sorted(windows):
        if united and start_s <= united[-1][1]:
            united[-1][1] = max(united[-1][1], end_s)
        else:
            united.append([start_s, end_s])
    return united
