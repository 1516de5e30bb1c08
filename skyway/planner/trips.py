"""Many trips as columns: the input of `compose_many`."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from skyway.delivery.request import MAX_TRIP_DESTINATIONS
from skyway.errors import InvalidProblem
from skyway.planner.kernels.memory import Floats, Ints, Longs
from skyway.planner.kernels.records import TripRows
from skyway.planner.trip_terms import TripTerms
from skyway.units import CHARGE_TOLERANCE

_MS_PER_S = 1000.0


@dataclass(frozen=True, slots=True, eq=False)
class Trips:
    """Trips as columns; rows of stations and moments are as in the `TripTerms`.

    Parameters
    ----------
    start_row, start_s, soc, model
        ``(n,)``: where and when the drone stands, in whole milliseconds, its state of charge, and
        the number of its model.
    source_row
        ``(n,)``: where the packages are.
    are_on_board
        ``(n,)`` bool: whether the drone has the packages; then loading takes no time, and needs no
        open station and no window.
    pickup_not_before_s, pickup_latest_s, latest_delivery_s
        ``(n,)``, infinite without a limit. The search of a trip that cannot deliver by its latest
        moment ends quickly. So a caller that looks for a better trip sets the moment to beat.
    package_offsets
        ``(n + 1,)`` int64: the packages of trip i are those from its offset to the next.
    destination_row, mass_kg, not_before_s, latest_s
        ``(m,)`` by package; windows as in a problem.
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
        """Trips of these columns; each argument is a column, or one value for all rows.

        `start_s` is rounded up to whole milliseconds.
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
        reserve = terms.reserve_soc
        _refuse("model", (self.model < 0) | (self.model >= len(terms.models)), "no such model")
        for name in ("start_row", "source_row", "destination_row"):
            rows = getattr(self, name)
            _refuse(name, (rows < 0) | (rows >= stations), f"there are {stations} stations")
        low = reserve[self.model] - CHARGE_TOLERANCE
        _refuse("soc", ~((self.soc >= low) & (self.soc <= 1.0)), "not between the reserve and 1")
        _refuse("start_s", ~((self.start_s >= 0.0) & np.isfinite(self.start_s)), "not 0 s or more")
        _refuse("mass_kg", ~(self.mass_kg >= 0.0), "not 0 kg or more")
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
