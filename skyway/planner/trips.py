"""Many trips as columns, and the terms that they have in common: the input of `compose_many`."""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt

from skyway.delivery.request import MAX_TRIP_DESTINATIONS
from skyway.drone.charging import fastest_s_per_soc
from skyway.drone.model import DroneModel
from skyway.errors import InvalidProblem
from skyway.ids import PackageId
from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.closures import open_hours_s
from skyway.planner.exact_task import closed_handle, curve_of, rounding_j
from skyway.planner.hierarchy import rows_of
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.memory import Floats, Ints, Longs
from skyway.planner.kernels.records import Closed, Skyway, Terms, TripRows
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem
from skyway.planner.problem_parts import Closure
from skyway.planner.situation import Situation
from skyway.units import CHARGE_TOLERANCE

_MS_PER_S = 1000.0


# Without slots: the handles for the kernels are made once, for all calls.
@dataclass(frozen=True, eq=False)
class TripTerms:
    """What many trips have in common, prepared once.

    `pattern` is a problem with the network, closures and rules of all trips; its drone and packages
    mean nothing. Trips name their drone model by its number in `models`. All moments are seconds
    from one zero, which is `start_at` where the network has dated zones or opening hours.
    """

    pattern: Problem
    models: tuple[DroneModel, ...]
    airspace: Airspace

    @classmethod
    def of(
        cls,
        network: Network,
        models: Sequence[DroneModel],
        *,
        start_at: datetime | None = None,
        closures: Sequence[Closure] = (),
        airspace: Airspace | None = None,
        recharge_policy: Literal["partial", "full"] = "partial",
        finish: Literal["recharge", "stay"] = "recharge",
        loading_s: float = 0.0,
        dropoff_s: float = 0.0,
    ) -> Self:
        """The terms of trips on this network; the fields are those of a `Problem`.

        Raises
        ------
        InvalidProblem
            The terms contradict one another, or there is no drone model.
        """
        if not models:
            raise InvalidProblem("models", "0 drone models, at least 1 is needed")
        anywhere = next(iter(network.row_of), None)
        if anywhere is None:
            raise InvalidProblem("network.features", "0 stations, at least 1 is needed")
        nothing = PackageToDeliver(package_id=PackageId("none"), mass_kg=0.0, destination=anywhere)
        pattern = Problem(
            network=network,
            start_at=start_at,
            drone=DroneAtStart(model=models[0], soc=1.0),
            source=anywhere,
            packages=(nothing,),
            closures=tuple(closures),
            recharge_policy=recharge_policy,
            finish=finish,
            loading_s=loading_s,
            dropoff_s=dropoff_s,
        )
        return cls(pattern, tuple(models), airspace or Airspace.of(network))

    @property
    def network(self) -> Network:
        """The network of all trips."""
        return self.pattern.network

    @cached_property
    def skyway(self) -> Skyway:
        """The network as the kernels read it."""
        return handle_of(rows_of(self.network))

    @cached_property
    def closed(self) -> Closed:
        """The closures as the kernels read them."""
        return closed_handle(Situation.of(self.pattern, self.airspace))

    @cached_property
    def rows(self) -> Terms:
        """The terms as the kernels read them."""
        models, stations = self.models, len(self.network.columns.station_ids)
        curves = [curve_of(model) for model in models]
        hours = self.network.opening_hours
        spans = [
            open_hours_s(self.pattern, station_id) if station_id in hours else ()
            for station_id in (self.network.columns.station_ids if hours else ())
        ]
        counts = np.array([len(each) for each in spans] or [0] * stations, np.int64)
        open_s = np.array([one for each in spans for one in each], np.float64).reshape(-1, 2)
        has_hours = np.zeros(stations, np.bool_)
        has_hours[[self.network.row_of[station_id] for station_id in hours]] = True
        finishes_anywhere = self.pattern.finish == "stay"
        record = Terms(
            empty_kg=_column(model.empty_mass_kg for model in models),
            payload_kg=_column(model.max_payload_kg for model in models),
            battery_j=_column(model.battery_j for model in models),
            reserve_j=_column(model.reserve_soc * model.battery_j for model in models),
            rounding_j=_column(rounding_j(model) for model in models),
            speed_empty_mps=_column(model.speed_empty_mps for model in models),
            speed_full_mps=_column(model.speed_full_mps for model in models),
            power_w=_column(model.power_empty_w for model in models),
            stop_s=_column(model.stop_s for model in models),
            stop_j=_column(model.stop_j for model in models),
            s_per_j=_column(fastest_s_per_soc(model) / model.battery_j for model in models),
            curve_offsets=np.cumsum([0, *(len(seconds) for seconds, _ in curves)], dtype=np.int64),
            curve_s=np.concatenate([seconds for seconds, _ in curves]),
            curve_j=np.concatenate([joules for _, joules in curves]),
            to_pad_m=np.zeros(stations) if finishes_anywhere else _to_pad_m(self.network),
            has_hours=has_hours,
            hours_offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            open_from_s=np.ascontiguousarray(open_s[:, 0]),
            open_until_s=np.ascontiguousarray(open_s[:, 1]),
            loading_s=self.pattern.loading_s,
            dropoff_s=self.pattern.dropoff_s,
            recharges_fully=self.pattern.recharge_policy == "full",
        )
        return handle_of(record)


def _column(values: Any) -> Floats:  # numbers of any kind
    return np.array(list(values), np.float64)


def _to_pad_m(network: Network) -> Floats:
    """Metres from each station to the nearest station with a pad; inf without one."""
    incoming = network.incoming
    length_m = np.where(network.columns.pads > 0, 0.0, np.inf)
    if (length_m == 0.0).all():
        return length_m
    heap = [(0.0, row) for row in np.flatnonzero(length_m == 0.0).tolist()]
    while heap:
        here_m, row = heapq.heappop(heap)
        if here_m > length_m[row]:
            continue
        at = incoming.at(row)
        for before, segment_m in zip(
            incoming.station[at].tolist(), incoming.length_m[at].tolist(), strict=True
        ):
            if here_m + segment_m < length_m[before]:
                length_m[before] = here_m + segment_m
                heapq.heappush(heap, (length_m[before], before))
    return length_m


@dataclass(frozen=True, slots=True, eq=False)
class Trips:
    """Trips as columns; station rows and the moments are those of the `TripTerms`.

    Parameters
    ----------
    start_row, start_s, soc, model
        ``(n,)``: where and when the drone stands, in whole milliseconds, its state of charge, and
        the number of its model.
    source_row
        ``(n,)``: where the packages are.
    are_on_board
        ``(n,)`` bool: loading takes no time then, and needs no open station.
    pickup_not_before_s, pickup_latest_s, latest_delivery_s
        ``(n,)``, infinite without a limit. A trip that cannot deliver by its latest moment is left
        quickly: a caller that looks for a better trip sets what is to be beaten.
    package_offsets
        ``(n + 1,)`` int64: the packages of trip i are those from its offset to the next.
    destination_row, mass_kg, not_before_s, latest_s
        ``(m,)`` by package; its window as in a problem.
    """

    start_row: Ints
    start_s: Floats
    soc: Floats
    model: Ints
    source_row: Ints
    are_on_board: npt.NDArray[np.bool_]
    pickup_not_before_s: Floats
    pickup_latest_s: Floats
    latest_delivery_s: Floats
    package_offsets: Longs
    destination_row: Ints
    mass_kg: Floats
    not_before_s: Floats
    latest_s: Floats

    @classmethod
    def of(
        cls,
        *,
        start_row: npt.ArrayLike,
        start_s: npt.ArrayLike,
        soc: npt.ArrayLike,
        source_row: npt.ArrayLike,
        package_offsets: npt.ArrayLike,
        destination_row: npt.ArrayLike,
        mass_kg: npt.ArrayLike,
        model: npt.ArrayLike = 0,
        are_on_board: npt.ArrayLike = False,
        pickup_not_before_s: npt.ArrayLike = -np.inf,
        pickup_latest_s: npt.ArrayLike = np.inf,
        latest_delivery_s: npt.ArrayLike = np.inf,
        not_before_s: npt.ArrayLike = -np.inf,
        latest_s: npt.ArrayLike = np.inf,
    ) -> Self:
        """These columns; one value for all rows may stand for a column.

        Moments of start are rounded up to whole milliseconds.
        """
        offsets = np.ascontiguousarray(package_offsets, np.int64)
        trips, packages = len(offsets) - 1, int(offsets[-1])
        started_ms = np.ceil(np.asarray(start_s, np.float64) * _MS_PER_S - 1e-3)
        return cls(
            _filled(start_row, trips, np.int32),
            _filled(started_ms / _MS_PER_S, trips, np.float64),
            _filled(soc, trips, np.float64),
            _filled(model, trips, np.int32),
            _filled(source_row, trips, np.int32),
            _filled(are_on_board, trips, np.bool_),
            _filled(pickup_not_before_s, trips, np.float64),
            _filled(pickup_latest_s, trips, np.float64),
            _filled(latest_delivery_s, trips, np.float64),
            offsets,
            _filled(destination_row, packages, np.int32),
            _filled(mass_kg, packages, np.float64),
            _filled(not_before_s, packages, np.float64),
            _filled(latest_s, packages, np.float64),
        )

    def __len__(self) -> int:
        return len(self.start_row)

    @property
    def rows(self) -> TripRows:
        """The trips as the kernels read them."""
        return TripRows(
            self.start_row,
            self.start_s,
            self.soc,
            self.model,
            self.source_row,
            self.are_on_board,
            self.pickup_not_before_s,
            self.pickup_latest_s,
            self.latest_delivery_s,
            self.package_offsets,
            self.destination_row,
            self.mass_kg,
            self.not_before_s,
            self.latest_s,
        )

    def check(self, terms: TripTerms) -> None:
        """Refuse trips that break a limit.

        Raises
        ------
        InvalidProblem
            Names the column, and the first trip or package at fault.
        """
        stations = len(terms.network.columns.station_ids)
        reserve = _column(model.reserve_soc for model in terms.models)
        _refuse("model", (self.model < 0) | (self.model >= len(terms.models)), "no such model")
        for name in ("start_row", "source_row", "destination_row"):
            rows = getattr(self, name)
            _refuse(name, (rows < 0) | (rows >= stations), f"there are {stations} stations")
        low = reserve[self.model] - CHARGE_TOLERANCE
        _refuse("soc", ~((self.soc >= low) & (self.soc <= 1.0)), "outside the reserve to 1")
        _refuse("start_s", ~((self.start_s >= 0.0) & np.isfinite(self.start_s)), "before the zero")
        _refuse("mass_kg", ~(self.mass_kg >= 0.0), "is not 0 kg or more")
        each = np.diff(self.package_offsets)
        _refuse("package_offsets", each < 1, "a trip needs a package")
        for trip in np.flatnonzero(each > MAX_TRIP_DESTINATIONS).tolist():
            first, end = self.package_offsets[trip], self.package_offsets[trip + 1]
            if len(np.unique(self.destination_row[first:end])) > MAX_TRIP_DESTINATIONS:
                raise InvalidProblem(
                    f"destination_row.{trip}", f"more than {MAX_TRIP_DESTINATIONS} destinations"
                )


def _filled(values: npt.ArrayLike, count: int, dtype: Any) -> Any:  # a column of this type
    column = np.asarray(values, dtype)
    if column.ndim == 0:
        return np.full(count, column, dtype)
    if column.shape != (count,):
        raise InvalidProblem("trips", f"a column has {column.shape} rows instead of {count}")
    return np.ascontiguousarray(column)


def _refuse(name: str, is_wrong: npt.NDArray[np.bool_], detail: str) -> None:
    if is_wrong.any():
        raise InvalidProblem(f"{name}.{int(is_wrong.argmax())}", detail)
