"""Where the fields of a problem contradict one another or its network."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from datetime import datetime

from skyway.complaints import unknown_name
from skyway.delivery.request import MAX_TRIP_DESTINATIONS
from skyway.errors import FieldFault
from skyway.ids import PackageId, StationId
from skyway.network.network import Network
from skyway.planner.problem_parts import (
    Closure,
    DroneAtStart,
    PackageToDeliver,
    PadReservation,
)
from skyway.planner.reservations import ReservationColumns
from skyway.units import CHARGE_TOLERANCE, TIME_TOLERANCE_S


def disagreements(
    network: Network,
    *,
    start_at: datetime | None,
    drone: DroneAtStart,
    source: StationId,
    packages: Sequence[PackageToDeliver],
    pad_reservations: Sequence[PadReservation],
    closures: Sequence[Closure],
) -> Iterator[FieldFault]:
    """Each contradiction of a problem, by the path of the field at fault."""
    if not network.stations:
        yield FieldFault("network.features", "0 stations, at least 1 is needed")
        return
    yield from _of_start(network, start_at)
    yield from _of_drone(network, drone)
    yield from _of_station(network, "source", source)
    yield from _of_packages(network, packages)
    yield from _of_reservations(network, pad_reservations)
    yield from _of_closures(network, closures)


def _of_start(network: Network, start_at: datetime | None) -> Iterator[FieldFault]:
    if start_at is None:
        for zone in network.zones:
            if zone.active_from is not None or zone.active_until is not None:
                yield FieldFault("start_at", f"is required: zone {zone.zone_id!r} has dates")
                return
        for station_id in network.opening_hours:
            yield FieldFault("start_at", f"is required: station {station_id!r} has opening hours")
            return


def _of_drone(network: Network, drone: DroneAtStart) -> Iterator[FieldFault]:
    reserve = drone.model.reserve_soc
    if drone.soc < reserve - CHARGE_TOLERANCE:
        yield FieldFault("drone.soc", f"{drone.soc} is below reserve_soc {reserve}")
    if drone.station_id is not None:
        yield from _of_station(network, "drone.station_id", drone.station_id)


def _of_packages(network: Network, packages: Sequence[PackageToDeliver]) -> Iterator[FieldFault]:
    if not packages:
        yield FieldFault("packages", "0 packages, at least 1 is needed")
    seen: set[PackageId] = set()
    for number, package in enumerate(packages):
        if package.package_id in seen:
            detail = f"a second package called {package.package_id!r}"
            yield FieldFault(f"packages.{number}.package_id", detail)
        seen.add(package.package_id)
        yield from _of_station(network, f"packages.{number}.destination", package.destination)
    destinations = {package.destination for package in packages}
    if len(destinations) > MAX_TRIP_DESTINATIONS:
        yield FieldFault(
            "packages",
            f"{len(destinations)} distinct destinations exceed the limit of "
            f"{MAX_TRIP_DESTINATIONS}",
        )


def _of_reservations(
    network: Network, reservations: Sequence[PadReservation]
) -> Iterator[FieldFault]:
    if isinstance(reservations, ReservationColumns) and reservations.fits(network):
        return
    reservations = tuple(reservations)
    stations = network.stations
    by_pad: dict[tuple[StationId, int], list[int]] = defaultdict(list)
    for number, reservation in enumerate(reservations):
        by_pad[reservation.station_id, reservation.pad].append(number)
        if reservation.end_s is not None and reservation.end_s <= reservation.start_s:
            yield _reversed(f"pad_reservations.{number}", reservation)
    for (station_id, pad), numbers in by_pad.items():
        field = f"pad_reservations.{numbers[0]}"
        if station_id not in stations:
            yield from _of_station(network, f"{field}.station_id", station_id)
        elif pad >= (pads := stations[station_id].pads):
            detail = (
                f"{pad} is not a pad of station {station_id!r}, which has {pads}, numbered from 0"
            )
            yield FieldFault(f"{field}.pad", detail)
        if len(numbers) > 1:
            yield from _of_overlaps(reservations, numbers)


def _of_overlaps(
    reservations: Sequence[PadReservation], numbers: list[int]
) -> Iterator[FieldFault]:
    """Reservations of one pad may touch; an overlap with the longest-lasting one is a fault."""
    by_start = sorted((reservations[number].start_s, number) for number in numbers)
    holder = by_start[0][1]
    for start_s, number in by_start[1:]:
        holder_end_s = reservations[holder].end_s
        if holder_end_s is None or start_s < holder_end_s - TIME_TOLERANCE_S:
            later, earlier = max(holder, number), min(holder, number)
            taken = reservations[earlier]
            until = "on" if taken.end_s is None else f"to {taken.end_s} s"
            detail = (
                f"overlaps pad_reservations.{earlier}: pad {taken.pad} of station "
                f"{taken.station_id!r} is reserved from {taken.start_s} s {until}"
            )
            yield FieldFault(f"pad_reservations.{later}", detail)
        end_s = reservations[number].end_s
        if holder_end_s is not None and (end_s is None or end_s > holder_end_s):
            holder = number


def _of_closures(network: Network, closures: Sequence[Closure]) -> Iterator[FieldFault]:
    for number, closure in enumerate(closures):
        field = f"closures.{number}"
        match closure.closes:
            case (from_id, to_id):
                unknown = [
                    *_of_station(network, f"{field}.from", from_id),
                    *_of_station(network, f"{field}.to", to_id),
                ]
                yield from unknown
                if not unknown and all(
                    segment.to_id != to_id for segment in network.segments_from(from_id)
                ):
                    yield FieldFault(field, f"no segment from {from_id!r} to {to_id!r}")
            case station_id:
                yield from _of_station(network, f"{field}.station_id", station_id)
        if closure.end_s is not None and closure.end_s <= closure.start_s:
            yield _reversed(field, closure)


def _of_station(network: Network, field: str, station_id: StationId) -> Iterator[FieldFault]:
    if station_id not in network.stations:
        yield FieldFault(field, unknown_name("station", station_id, network.stations))


def _reversed(field: str, span: PadReservation | Closure) -> FieldFault:
    return FieldFault(f"{field}.end_s", f"{span.end_s} is not after start_s {span.start_s}")
