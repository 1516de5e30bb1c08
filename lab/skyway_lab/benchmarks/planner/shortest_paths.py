"""One-to-all shortest paths: our reverse tree beside four libraries, all on the same network."""

import statistics
import time
from typing import Any

import numpy as np
import numpy.typing as npt
from skyway_lab.benchmarks.planner.cities import SEED, city
from skyway_lab.benchmarks.planner.distribution import milliseconds
from skyway_lab.benchmarks.planner.our_tree import OurTree
from skyway_lab.benchmarks.planner.peers.interface import PathPeer, PathTask
from skyway_lab.benchmarks.planner.peers.roster import label, missing, peers
from skyway_lab.benchmarks.planner.table import Table

_STATIONS = 100_000
_RUNS = 5


def shortest_paths() -> Table:
    """Milliseconds for a whole tree, and for the graph in the library's own form before."""
    network = city(_STATIONS)
    columns = network.columns
    task = PathTask(_STATIONS, columns.from_row, columns.to_row, columns.length_m)
    sources = np.random.default_rng(SEED).integers(_STATIONS, size=_RUNS).tolist()
    table = Table(
        "shortest-paths",
        f"**Shortest paths** from one station to all {_STATIONS:,}, median milliseconds of "
        f"{_RUNS} sources.",
        ("library", "one to all", "graph prepared", "same lengths"),
    )
    expected: list[npt.NDArray[np.float64]] = []
    competitors: list[PathPeer] = [OurTree(network), *peers("paths")]
    for peer in competitors:
        started = time.perf_counter()
        graph = peer.prepare(task)
        prepared_ms = 1000 * (time.perf_counter() - started)
        # Not counted: the first call loads or compiles code.
        peer.lengths_m(graph, sources[0])
        runs = [_timed(peer, graph, source) for source in sources]
        expected = expected or [found for _, found in runs]
        is_same = all(
            np.allclose(found, lengths_m)
            for (_, found), lengths_m in zip(runs, expected, strict=True)
        )
        median_ms = statistics.median(time_ms for time_ms, _ in runs)
        name = label(peer.package)
        texts = (milliseconds(median_ms), milliseconds(prepared_ms), "yes" if is_same else "NO")
        table.rows.append((name, *texts))
        table.numbers.append(
            {"library": name, "ms": median_ms, "prepared_ms": prepared_ms, "is_same": is_same}
        )
    table.remarks = missing("paths")
    return table


def _timed(
    peer: PathPeer,
    graph: Any,  # the peer's own
    source: int,
) -> tuple[float, npt.NDArray[np.float64]]:
    started = time.perf_counter()
    found = peer.lengths_m(graph, source)
    return 1000 * (time.perf_counter() - started), found
