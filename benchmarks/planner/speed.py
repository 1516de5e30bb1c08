"""planner.md's two tables: whole-network requests and local ones, by stations and packages."""

from collections.abc import Iterator
from dataclasses import asdict

from benchmarks.planner.cell import LOCAL_REACH_M, Cell, Policy
from benchmarks.planner.cities import city
from benchmarks.planner.congestion import WHOLE_UP_TO, Congestion, book
from benchmarks.planner.extent import Extent
from benchmarks.planner.requests import requests, source_rows
from benchmarks.planner.solving import Measured, measured, solve_all
from benchmarks.planner.table import Table

_HOUR_S = 3_600.0


def whole_network(extent: Extent) -> Table:
    """Destinations spread over the whole network."""
    caption = (
        "**Whole-network requests**: milliseconds for the whole solve, median / p95 / worst, by "
        "the share of the pads' time that is taken."
    )
    stations = extent.whole_stations
    return _table("whole-network", caption, extent, stations=stations, reach_m=None)


def local(extent: Extent) -> Table:
    """Destinations within 45 km of the source."""
    caption = (
        f"**Local requests**, destinations within {LOCAL_REACH_M / 1000:g} km: milliseconds for "
        "the whole solve, median / p95 / worst, by the share of the pads' time that is taken."
    )
    stations = extent.local_stations
    return _table("local", caption, extent, stations=stations, reach_m=LOCAL_REACH_M)


def horizon_s(stations: int, reach_m: float | None) -> float:
    """How long the pads stay taken: a day, on the widest plans three, so that none outlasts it."""
    return 72 * _HOUR_S if reach_m is None and stations > 10_000 else 24 * _HOUR_S


def _table(
    name: str, caption: str, extent: Extent, *, stations: tuple[int, ...], reach_m: float | None
) -> Table:
    is_local = reach_m is not None
    partial = extent.local_taken if is_local else extent.whole_taken
    shares = sorted({*partial, *extent.full_taken})
    header = ("stations", "packages", "recharge", *(f"{share:.0%} taken" for share in shares))
    table = Table(name, caption, (*header, "recharges", "labels", "MiB"))
    for count in stations:
        cells = dict(_measured_cells(count, reach_m, partial, extent))
        for policy in ("partial", "full"):
            for packages in extent.packages:
                row = [cells.get((policy, packages, share)) for share in shares]
                table.rows.append((f"{count:,}", str(packages), policy, *_as_texts(row)))
        for (policy, packages, share), cell in cells.items():
            key = {"stations": count, "packages": packages, "policy": policy, "taken": share}
            table.numbers.append({**key, **asdict(cell)})
    table.remarks = _remarks(extent, is_local=is_local)
    return table


def _measured_cells(
    stations: int, reach_m: float | None, partial: tuple[float, ...], extent: Extent
) -> Iterator[tuple[tuple[Policy, int, float], Measured]]:
    network = city(stations)
    sources = source_rows(network, extent.limits.runs)
    wanted: dict[Policy, tuple[float, ...]] = {"partial": partial, "full": extent.full_taken}
    for taken in sorted({*partial, *extent.full_taken}):
        congestion = Congestion(taken, horizon_s(stations, reach_m))
        pads = book(network, congestion, sources=sources)
        for policy, shares in wanted.items():
            for packages in extent.packages if taken in shares else ():
                cell = Cell(stations, packages, policy, reach_m)
                limits = extent.limits
                problems = requests(network, cell, runs=limits.runs, limit_s=limits.solve_s)
                solved = solve_all(problems, book=pads, limits=limits)
                yield (policy, packages, taken), measured(solved, book=pads, limits=limits)


def _as_texts(row: list[Measured | None]) -> list[str]:
    """The times, then the most recharges, labels and memory of the row's cells."""
    measured_ones = [cell for cell in row if cell is not None]
    peaks_mib = [cell.peak_mib for cell in measured_ones if cell.peak_mib is not None]
    return [
        *("" if cell is None else cell.times.as_text() for cell in row),
        f"{max((cell.recharges for cell in measured_ones), default=0):.1f}",
        f"{max((cell.labels for cell in measured_ones), default=0):,.0f}",
        f"{max(peaks_mib):.1f}" if peaks_mib else "unknown",
    ]


def _remarks(extent: Extent, *, is_local: bool) -> list[str]:
    limits = extent.limits
    remarks = [
        (
            f"{limits.runs} seeded runs a cell, none solved longer than {limits.solve_s:g} s, a "
            f"cell no longer than {limits.cell_s:g} s; (n of m) proven of the runs made, where "
            f"not all {limits.runs} were: quantiles count the others as later than all."
        ),
        (
            "recharges and labels: the largest mean of the row's cells; MiB: the most memory that "
            "the slowest request of a cell took while it was solved."
        ),
    ]
    if is_local:
        remarks.append(
            f"Above {WHOLE_UP_TO:,} stations the pads within 150 km of a source are reserved, "
            "the others free: reservations everywhere would not be looked at either."
        )
    else:
        remarks.append(
            "Pads are taken for the first 24 h, at 100,000 stations for the first 72 h, and free "
            "afterwards."
        )
    return remarks
