"""What others are told of a revision: which packages come back, and how the mission goes on."""

from dataclasses import replace

from skyway_composition.missions.record import Aim, MissionRecord
from skyway_composition.missions.report import report
from skyway_composition.missions.rest.aiming import turned_back
from skyway_composition.missions.watch import Watch


def with_aims(
    watch: Watch, record: MissionRecord, aims: tuple[Aim, ...], *, code: str, detail: str
) -> MissionRecord:
    """The record with these aims, once it is told what goes back to the pickup now."""
    turned = turned_back(record.aims, aims)
    record = replace(record, aims=aims)
    if not turned:
        return record
    return report(
        watch,
        record,
        "RETURNING",
        at=watch.clock.now(),
        package_ids=turned,
        code=code,
        detail=detail,
    )


def told_replanned(watch: Watch, record: MissionRecord, *, code: str, detail: str) -> MissionRecord:
    """The record once it is told that its mission goes on by another plan, and why."""
    return report(
        watch,
        record,
        "REPLANNED",
        at=watch.clock.now(),
        code=code,
        detail=detail,
        etas=record.mission.packages,
        mission=record.mission,
    )
