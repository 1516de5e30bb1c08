"""The first steps of a mission's life: its drone takes it, and begins it."""

from datetime import datetime

from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.report import report
from skyway_composition.missions.states import moved
from skyway_composition.missions.watch import Watch


def accepted(watch: Watch, record: MissionRecord) -> MissionRecord:
    """The record once the drone has taken the mission; whoever flies it has accepted it."""
    if record.mission.state != "BOOKED":
        return record
    record = moved(record, "ACCEPTED")
    return report(watch, record, "ACCEPTED", at=watch.clock.now())


def begun(watch: Watch, record: MissionRecord, *, at: datetime) -> MissionRecord:
    """The record once the drone has begun: it approaches the pickup, or loads there."""
    record = accepted(watch, record)
    if record.mission.state != "ACCEPTED":
        return record
    record = moved(record, "ACTIVE")
    return report(watch, record, "LOADING", at=at)
