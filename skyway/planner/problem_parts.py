"""The parts of a problem: the drone at its start, packages, reservations, closures.

Windows of packages that contradict themselves or one another are found here too.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from skyway.drone.cargo import CargoNeeds
from skyway.drone.model import DroneModel
from skyway.errors import FieldFault
from skyway.ids import PackageId, StationId
from skyway.json_model import JsonModel
from skyway.network.network import MAX_PADS
from skyway.units import TIME_TOLERANCE_S

#: Seconds, about three centuries: no moment or duration of a problem lies further away.
MAX_SECONDS = 1e10

#: The most reservations, and the most closures, of one problem.
MAX_HELD = 100_000

#: Kilograms; far above any drone, so that a package too heavy to fly gets a proof, not a complaint.
MAX_PACKAGE_KG = 1e12


Seconds = Annotated[
    float,
    Field(ge=-MAX_SECONDS, le=MAX_SECONDS, description="seconds since the plan's start"),
]

Duration = Annotated[float, Field(ge=0, le=MAX_SECONDS, description="seconds")]


class DroneAtStart(JsonModel):
    """The drone, its charge at time 0, and where it stands then (null: at the source)."""

    model: Annotated[DroneModel, Field(description="The type of drone.")]
    soc: Annotated[float, Field(le=1, description="State of charge at time 0, up to 1.")]
    station_id: StationId | None = None


class PackageToDeliver(CargoNeeds):
    """A package, what it needs of its drone, and the station and window of its hand-over."""

    package_id: PackageId
    mass_kg: Annotated[float, Field(ge=0, le=MAX_PACKAGE_KG, description="Mass in kilograms.")]
    destination: StationId
    not_before_s: Annotated[
        Seconds | None, Field(description="The hand-over does not begin before.")
    ] = None
    latest_s: Annotated[Seconds | None, Field(description="The hand-over is over by then.")] = None


class PadReservation(JsonModel):
    """A pad that another drone holds in [start_s, end_s); without end it is out of order."""

    station_id: StationId
    pad: Annotated[
        int,
        Field(ge=0, lt=MAX_PADS, description="The number of the pad, from 0."),
    ]
    start_s: Seconds
    end_s: Seconds | None = None


class StationClosure(JsonModel):
    """A station where no drone lands in [start_s, end_s); a missing end is open."""

    station_id: StationId
    start_s: Seconds
    end_s: Seconds | None = None

    @property
    def closes(self) -> StationId:
        """What is closed."""
        return self.station_id


class SegmentClosure(JsonModel):
    """A segment that no drone flies, in this direction, in [start_s, end_s)."""

    from_id: Annotated[StationId, Field(alias="from")]
    to_id: Annotated[StationId, Field(alias="to")]
    start_s: Seconds
    end_s: Seconds | None = None

    @property
    def closes(self) -> tuple[StationId, StationId]:
        """What is closed, by its ends."""
        return self.from_id, self.to_id


def _closure_kind(closure: Any) -> str:  # any JSON value; its model checks it
    if isinstance(closure, Mapping):
        return "station" if "station_id" in closure else "segment"
    return "station" if isinstance(closure, StationClosure) else "segment"


Closure = Annotated[
    Annotated[StationClosure, Tag("station")] | Annotated[SegmentClosure, Tag("segment")],
    Discriminator(_closure_kind),
]


@dataclass(frozen=True, slots=True)
class TimedAct:
    """Loading or a hand-over: its window, None without a limit, and how long it takes, seconds."""

    not_before_s: float | None
    latest_s: float | None
    takes_s: float


def window_faults(
    packages: Sequence[PackageToDeliver], *, loading: TimedAct, dropoff_s: float
) -> Iterator[FieldFault]:
    """Each window that is reversed or too short, and each pair for one station that cannot meet."""
    detail = _contradiction(loading, "pickup_not_before_s", act="loading")
    if detail is not None:
        yield FieldFault("pickup_latest_s", detail)
    is_good = True
    for number, package in enumerate(packages):
        window = TimedAct(package.not_before_s, package.latest_s, dropoff_s)
        detail = _contradiction(window, "not_before_s", act="the hand-over")
        if detail is not None:
            is_good = False
            yield FieldFault(f"packages.{number}.latest_s", detail)
    if is_good:
        yield from _of_shared_stations(packages, dropoff_s)


def _contradiction(window: TimedAct, first_field: str, *, act: str) -> str | None:
    if window.not_before_s is None or window.latest_s is None:
        return None
    room_s = window.latest_s - window.not_before_s
    if room_s < 0:
        return f"{window.latest_s:g} is before {first_field} {window.not_before_s:g}"
    if room_s < window.takes_s - TIME_TOLERANCE_S:
        return f"{room_s:g} s after {first_field}, {act} takes {window.takes_s:g} s"
    return None


def _of_shared_stations(
    packages: Sequence[PackageToDeliver], dropoff_s: float
) -> Iterator[FieldFault]:
    """Packages for one station are handed over together, so their windows must overlap."""
    latest_to_begin: dict[StationId, tuple[float, int]] = {}
    soonest_to_end: dict[StationId, tuple[float, int]] = {}
    for number, package in enumerate(packages):
        here = package.destination
        if package.not_before_s is not None:
            one = (package.not_before_s, number)
            latest_to_begin[here] = max(latest_to_begin.get(here, one), one)
        if package.latest_s is not None:
            one = (package.latest_s, number)
            soonest_to_end[here] = min(soonest_to_end.get(here, one), one)
    for station_id, (latest_s, number) in soonest_to_end.items():
        not_before_s, other = latest_to_begin.get(station_id, (latest_s - dropoff_s, number))
        room_s = latest_s - not_before_s
        if room_s < dropoff_s - TIME_TOLERANCE_S:
            yield FieldFault(
                f"packages.{number}.latest_s",
                f"{latest_s:g} is {dropoff_s - room_s:g} s too early for packages.{other}, which "
                f"goes to {station_id!r} too and is handed over with it, not before "
                f"{not_before_s:g}",
            )
