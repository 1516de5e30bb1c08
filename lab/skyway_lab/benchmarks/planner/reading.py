"""How long it takes to read a problem with many reservations, and to sort them into a book."""

import json
import time
from collections.abc import Callable
from typing import Any, Final, TypeVar

from skyway_lab.benchmarks.planner.cities import SEED, city
from skyway_lab.benchmarks.planner.distribution import milliseconds
from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.instances import taken_pads

from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.json_text import json_value
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import Problem
from skyway.planner.problem_document import read_problem

_STATIONS: Final = 1_000
_RESERVATIONS: Final = (100, 1_000, 10_000, 100_000)
_TAKEN: Final = 0.7
_RUNS: Final = 7

_Answer = TypeVar("_Answer")


def reading() -> Table:
    """Processor time, the least of some runs that take turns."""
    table = Table(
        "reading",
        f"**Reading** a problem with its reservations ({_STATIONS:,} stations, {_TAKEN:.0%} "
        f"taken); milliseconds of processor time, the least of {_RUNS} runs.",
        ("reservations", "JSON", "problem", "book", "all", "one by one: problem", "book", "all"),
    )
    network = city(_STATIONS)
    held = [
        one.model_dump()
        for one in taken_pads(network, share=_TAKEN, seed=SEED, horizon_s=400 * 3_600.0)
    ]
    source, destination, *_ = network.stations
    document = {
        "drone": {"model": DJI_MATRICE_300_RTK.model_dump(mode="json"), "soc": 0.9},
        "source": source,
        "packages": [{"package_id": "p1", "mass_kg": 1.0, "destination": destination}],
    }
    for count in _RESERVATIONS:
        text = json.dumps({**document, "pad_reservations": held[:count]})
        # Only lists are read by the column. A tuple is read one by one, as lists were before.
        runs = [
            (*_read(text, network, list), *_read(text, network, tuple)[1:]) for _ in range(_RUNS)
        ]
        json_ms, *others = map(min, zip(*runs, strict=True))
        by_column_ms, one_by_one_ms = others[:2], others[2:]
        times_ms = (json_ms, *by_column_ms, json_ms + sum(by_column_ms))
        times_ms += (*one_by_one_ms, json_ms + sum(one_by_one_ms))
        table.rows.append((f"{count:,}", *map(milliseconds, times_ms)))
        table.numbers.append({"reservations": count, "times_ms": times_ms})
    return table


def _read(
    text: str,
    network: Any,  # as `read_problem` accepts it
    kind: Callable[[list[Any]], Any],  # any JSON values
) -> tuple[float, float, float]:
    """Milliseconds for the JSON text, for the problem, and for the book of its reservations."""
    document, json_ms = _timed(lambda: json_value(text))
    document["network"] = network
    document["pad_reservations"] = kind(document["pad_reservations"])
    problem, problem_ms = _timed(lambda: read_problem(document))
    _, book_ms = _timed(lambda: _book(problem))
    return json_ms, problem_ms, book_ms


def _book(problem: Problem) -> PadBook:
    return PadBook.of(problem.network, problem.pad_reservations)


def _timed(work: Callable[[], _Answer]) -> tuple[_Answer, float]:
    began_s = time.process_time()
    answer = work()
    return answer, 1000 * (time.process_time() - began_s)
