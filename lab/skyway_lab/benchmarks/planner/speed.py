"""Two tables: whole-network requests and local ones, by stations and packages."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass

from skyway_lab.benchmarks.planner.cell import LOCAL_REACH_M, Cell, Policy
from skyway_lab.benchmarks.planner.cities import city
from skyway_lab.benchmarks.planner.congestion import WHOLE_UP_TO, Congestion, book
from skyway_lab.benchmarks.planner.extent import Extent, Shares
from skyway_lab.benchmarks.planner.prepared import Prepared, hierarchy_of
from skyway_lab.benchmarks.planner.requests import requests, source_rows
from skyway_lab.benchmarks.planner.solving import Limits, Measured, measured, solve_all
from skyway_lab.benchmarks.planner.table import Table

from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.hierarchy import Hierarchy

_HOUR_S = 3_600.0
_COLUMNS = "milliseconds for the whole solve, median / p95 / worst, by the share of pad time"
_LABELS = "recharges and labels: the largest mean of the row's cells; MiB: the most memory that"


@dataclass(frozen=True, slots=True)
class _Sheet:
    """What one table varies, and what it has in common."""

    stations: tuple[int, ...]
    packages: tuple[int, ...]
    shares: Shares
    limits: Limits
    reach_m: float | None = None

    @property
    def taken(self) -> list[float]:
        """The shares of the pads' time, in rising order."""
        return sorted({share for shares in self.shares.values() for share in shares})


def whole_network(extent: Extent) -> Table:
    """Destinations spread over the whole network, which has a hierarchy."""
    sheet = _Sheet(extent.whole_stations, extent.packages, extent.whole_shares, extent.limits)
    caption = f"**Whole-network requests** on prepared networks: {_COLUMNS} taken."
    table = _empty("whole-network", caption, sheet)
    # Not counted: that the compiled code is loaded when it is first asked for.
    hierarchy_of(city(sheet.stations[0]))
    prepared_s = []
    for stations in sheet.stations:
        hierarchy, took_s = hierarchy_of(city(stations))
        prepared_s.append(f"{took_s:.2g} s at {stations:,}")
        _add(table, sheet, city(stations), hierarchy)
    table.remarks = [
        *_remarks(sheet.limits),
        (
            "Pads are taken for the first 24 h, at 100,000 stations for the first 72 h, and free "
            "afterwards."
        ),
        f"Making the hierarchy, once for a network: {', '.join(prepared_s)} stations.",
    ]
    return table


def unprepared(extent: Extent) -> Table:
    """The same without a hierarchy: a tree is grown for each destination of each request."""
    sheet = _Sheet(extent.tree_stations, extent.packages, extent.tree_shares, extent.limits)
    caption = f"**Whole-network requests** on networks without a hierarchy: {_COLUMNS} taken."
    table = _empty("unprepared", caption, sheet)
    for stations in sheet.stations:
        _add(table, sheet, city(stations), None)
    return table


def local(extent: Extent) -> Table:
    """Destinations within 45 km of the source; no network has a hierarchy."""
    stations, shares = extent.local_stations, extent.local_shares
    sheet = _Sheet(stations, extent.packages, shares, extent.limits, LOCAL_REACH_M)
    caption = (
        f"**Local requests**, destinations within {LOCAL_REACH_M / 1000:g} km: {_COLUMNS} "
        "taken. No network is prepared with a hierarchy."
    )
    table = _empty("local", caption, sheet)
    for count in sheet.stations:
        _add(table, sheet, city(count), None)
    table.remarks = [
        *_remarks(sheet.limits),
        (
            f"Above {WHOLE_UP_TO:,} stations the pads within 150 km of a source are reserved, the "
            "others free: reservations everywhere would not be looked at either."
        ),
    ]
    return table


def horizon_s(stations: int, reach_m: float | None) -> float:
    """How long the pads stay taken: a day, on the widest plans three."""
    return 72 * _HOUR_S if reach_m is None and stations > 10_000 else 24 * _HOUR_S


def _empty(name: str, caption: str, sheet: _Sheet) -> Table:
    shares = (f"{share:.0%} taken" for share in sheet.taken)
    return Table(
        name,
        caption,
        ("stations", "packages", "recharge", *shares, "recharges", "labels", "MiB"),
    )


def _add(table: Table, sheet: _Sheet, network: Network, hierarchy: Hierarchy | None) -> None:
    """The rows of one network."""
    stations = len(network.columns.station_ids)
    cells = dict(_measured_cells(sheet, network, hierarchy))
    for policy, shares in sheet.shares.items():
        for packages in sheet.packages if shares else ():
            row = [cells.get((policy, packages, share)) for share in sheet.taken]
            table.rows.append((f"{stations:,}", str(packages), policy, *_as_texts(row)))
    for (policy, packages, share), cell in cells.items():
        key = {"stations": stations, "packages": packages, "policy": policy, "taken": share}
        table.numbers.append({**key, **asdict(cell)})


def _measured_cells(
    sheet: _Sheet, network: Network, hierarchy: Hierarchy | None
) -> Iterator[tuple[tuple[Policy, int, float], Measured]]:
    stations = len(network.columns.station_ids)
    limits = sheet.limits
    sources = source_rows(network, limits.runs)
    for taken in sheet.taken:
        congestion = Congestion(taken, horizon_s(stations, sheet.reach_m))
        pads = book(network, congestion, sources=sources)
        prepared = Prepared(pads, Airspace.of(network), hierarchy)
        for policy, shares in sheet.shares.items():
            for packages in sheet.packages if taken in shares else ():
                cell = Cell(stations, packages, policy, sheet.reach_m)
                problems = requests(network, cell, runs=limits.runs, limit_s=limits.solve_s)
                solved = solve_all(problems, prepared, limits=limits)
                yield (policy, packages, taken), measured(solved, prepared, limits=limits)


def _as_texts(row: list[Measured | None]) -> list[str]:
    """The times, then the most recharges, labels and memory of the row's cells."""
    measured_ones = [cell for cell in row if cell is not None]
    peaks_mib = [cell.peak_mib for cell in measured_ones if cell.peak_mib is not None]
    return [
        *("" if cell is None else _as_text(cell) for cell in row),
        f"{max((cell.recharges for cell in measured_ones), default=0):.1f}",
        f"{max((cell.labels for cell in measured_ones), default=0):,.0f}",
        f"{max(peaks_mib):.1f}" if peaks_mib else "unknown",
    ]


def _as_text(cell: Measured) -> str:
    gap = "" if cell.gap is None else f", gap {cell.gap:.1%}"
    return f"{cell.times.as_text()}{gap}"


def _remarks(limits: Limits) -> list[str]:
    return [
        (
            f"{limits.runs} seeded runs a cell, none solved longer than {limits.solve_s:g} s, a "
            f"cell no longer than {limits.cell_s:g} s; (n of m) proven of the runs made, where "
            f"not all {limits.runs} were: quantiles count the others as later than all."
        ),
        "gap: by so much at most the plans that were cut off are later than the best, as stated.",
        f"{_LABELS} the slowest request of a cell took while it was solved.",
    ]
