"""Where packages on board can go when they cannot reach their destinations."""

from collections.abc import Collection, Iterator

from skyway.delivery.request import Package
from skyway.ids import PackageId
from skyway_composition.missions.mission.record import Aim, MissionRecord
from skyway_composition.planning.closed_ahead import ClosedAhead


def aims_to_try(
    record: MissionRecord, carried: frozenset[PackageId], closed: ClosedAhead
) -> Iterator[tuple[Aim, ...]]:
    """The aims to try: the present ones; without stations closed for good; all to the pickup."""
    yield record.aims
    if not carried:
        return
    on_board = record.packages(carried)
    hopeless = [each for each in on_board if closed.is_closed_for_good(record.aim_of(each))]
    turned = with_changed_aims(record.aims, [_instead(record, each, closed) for each in hopeless])
    if hopeless:
        yield turned
    returned = with_changed_aims(record.aims, [back_to_pickup(record, each) for each in on_board])
    if returned not in (record.aims, turned):
        yield returned


def absent_aim(record: MissionRecord, package: Package) -> Aim:
    """Where a package goes when its recipient was absent; its alternative is tried once."""
    other = package.alternative
    if other is None or record.aim_of(package) != package.destination.station_id:
        return back_to_pickup(record, package)
    return Aim(package_id=package.package_id, station_id=other.station_id, kind="DELIVER")


def back_to_pickup(record: MissionRecord, package: Package) -> Aim:
    """The aim of a package that goes back to the pickup."""
    pickup = record.request.pickup.station_id
    return Aim(package_id=package.package_id, station_id=pickup, kind="RETURN")


def with_changed_aims(aims: tuple[Aim, ...], changed: Collection[Aim]) -> tuple[Aim, ...]:
    """The aims with the changed ones in place of earlier aims of the same packages."""
    ids = {each.package_id for each in changed}
    return (*(each for each in aims if each.package_id not in ids), *changed)


def turned_back(before: tuple[Aim, ...], after: tuple[Aim, ...]) -> tuple[PackageId, ...]:
    """The packages that go back to the pickup now and did not before."""
    returning = {each.package_id for each in before if each.kind == "RETURN"}
    return tuple(
        each.package_id
        for each in after
        if each.kind == "RETURN" and each.package_id not in returning
    )


def _instead(record: MissionRecord, package: Package, closed: ClosedAhead) -> Aim:
    other = package.alternative
    if other is None or closed.is_closed_for_good(other.station_id):
        return back_to_pickup(record, package)
    return Aim(package_id=package.package_id, station_id=other.station_id, kind="DELIVER")
