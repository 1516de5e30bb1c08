"""What many trips have in common, prepared once for `compose_many`."""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np

from skyway.drone.charging import fastest_s_per_soc, model_on_pad
from skyway.drone.model import DroneModel
from skyway.errors import InvalidProblem
from skyway.ids import PackageId
from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.charge_curves import curves_of
from skyway.planner.closures import open_hours_s
from skyway.planner.exact_task import closed_handle, rounding_j
from skyway.planner.hierarchy import rows_of
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.memory import Floats
from skyway.planner.kernels.records import Closed, Skyway, Terms
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem
from skyway.planner.problem_parts import Closure
from skyway.planner.situation import Situation


# Without slots: the handles for the kernels are made once, for all calls.
@dataclass(frozen=True, eq=False)
class TripTerms:
    """What many trips have in common, prepared once.

    `pattern` is a problem with the network, closures and rules of all trips; its drone and packages
    are not used. Trips name their drone model by its number in `models`. All moments are seconds
    from one common zero. If the network has dated zones or opening hours, the zero is `start_at`.
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
            The terms contradict one another, there is no drone model, or not all models fit the
            same pads.
        """
        if not models:
            raise InvalidProblem("models", "0 drone models, at least 1 is needed")
        anywhere = next(iter(network.row_of), None)
        if anywhere is None:
            raise InvalidProblem("network.features", "0 stations, at least 1 is needed")
        if len({id(network.fitting(model.connector)) for model in models}) > 1:
            detail = "they do not all fit the same pads: make terms for the drones of one connector"
            raise InvalidProblem("models", detail)
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

    @cached_property
    def reserve_soc(self) -> Floats:
        """The reserve of each model, ``(n_models,)``."""
        return _column(model.reserve_soc for model in self.models)

    @property
    def network(self) -> Network:
        """The network of all trips, without pads that do not fit their drones."""
        return self.pattern.network.fitting(self.models[0].connector)

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
        powers = self.network.pad_powers
        curves = [curves_of(model, powers) for model in models]
        fastest = [model_on_pad(model, powers.steps_w[0]) for model in models]
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
            s_per_j=_column(fastest_s_per_soc(model) / model.battery_j for model in fastest),
            curve_at=powers.step,
            curve_offsets=np.cumsum(
                [0, *(count for each in curves for count in np.diff(each.offsets))], dtype=np.int64
            ),
            curve_s=np.concatenate([each.seconds for each in curves]),
            curve_j=np.concatenate([each.joules for each in curves]),
            to_pad_m=np.zeros(stations) if finishes_anywhere else to_pad_m(self.network),
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


def to_pad_m(network: Network) -> Floats:
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
