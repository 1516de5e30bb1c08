"""What the drones of a busy world have done, by their own journals."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share_views import owner_of

from tests.composition.flown_drone import FlownDrone

#: A package on a drone: the mission, and the id under which the package flies.
Flying = tuple[str | None, str]


def ended_missions(drones: Sequence[FlownDrone]) -> set[str]:
    """The missions whose end is in a drone's journal."""
    return {
        each.mission_id or ""
        for drone in drones
        for each in drone.journal.happened
        if each.event == "MISSION_ENDED"
    }


def handed_over(
    drones: Sequence[FlownDrone], *, owners: Mapping[Flying, tuple[str, str]] | None = None
) -> Iterator[tuple[str, str]]:
    """Each hand-over of a package, as delivery and package.

    `owners` says which package of which delivery it is, where the drone's id does not.
    """
    for drone in drones:
        for event in drone.journal.happened:
            # After a wait for proofs a step may fail, and names what was handed over.
            how = (event.event, event.code)
            is_done = how in (("STEP_ENDED", None), ("STEP_FAILED", "RECIPIENT_ABSENT"))
            if is_done and event.step_kind == "DELIVER":
                for package_id in event.package_ids:
                    # The id of a package begins with the id of its delivery.
                    alone = package_id.split("_")[0], package_id
                    yield (owners or {}).get((event.mission_id, package_id), alone)


def owners_of(records: Iterable[MissionRecord]) -> dict[Flying, tuple[str, str]]:
    """The delivery of each package of these missions, and the id that its customer gave it."""
    return {
        (record.mission_id, each): owner_of(record, each)
        for record in records
        for each in (
            *(one.package_id for one in record.request.packages),
            *(flying for share in record.shares for flying in share.packages),
        )
    }


def shared_pads(
    drones: Sequence[FlownDrone], *, given_up: set[str]
) -> Iterator[tuple[str, str, str]]:
    """Where two drones have charged on the same pad at the same time.

    Missions in `given_up` do not count: their drones may fly on without reserved pads.
    """
    sessions = sorted(
        (each.station_id or "", each.started_at, each.ended_at, drone.drone_id)
        for drone in drones
        for each in drone.journal.happened
        if (each.event, each.step_kind) == ("STEP_ENDED", "RECHARGE") and each.started_at
        if each.mission_id not in given_up
    )
    for (station_id, _, ended_at, one), (other_id, began_at, _, other) in pairwise(sessions):
        if station_id == other_id and began_at < ended_at and one != other:
            yield station_id, one, other
