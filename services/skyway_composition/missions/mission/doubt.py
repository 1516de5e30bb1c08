"""Puts a mission in doubt when nobody knows what its drone has done, and ends the doubt.

A mission in doubt keeps its drone, its pads and its packages. So no second drone gets the packages
while the first drone may have them, or may have delivered them.
"""

from dataclasses import replace
from typing import Literal

from skyway.contracts.mission import Doubt
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, raise_alarm, report


async def put_in_doubt(
    work: MissionUnitOfWork,
    record: MissionRecord,
    *,
    code: Literal["NO_ANSWER", "SILENT", "JOURNAL_LOST"],
    detail: str,
) -> MissionRecord:
    """The record in doubt, saved; operators get an alarm, and the customer a report.

    The first reason stays. Only JOURNAL_LOST replaces another reason, because the drone itself does
    not know then what it did before.
    """
    earlier = record.mission.doubt
    if earlier is not None and (code != "JOURNAL_LOST" or earlier.code == code):
        return record
    now = work.clock.now()
    doubt = Doubt(code=code, detail=detail, since_at=now)
    record = replace(
        record,
        mission=record.mission.model_copy(update={"doubt": doubt}),
        reported_activity="OUT_OF_CONTACT ",
    )
    record = report(
        work,
        record,
        "ACTIVITY",
        at=now,
        activity="OUT_OF_CONTACT",
        code=code,
        detail=detail,
    )
    await raise_alarm(
        work,
        record,
        level="CRITICAL",
        code="MISSION_IN_DOUBT",
        detail=f"{detail}; the mission waits until the drone reports or an operator gives it up",
        data={"doubt": code, "mission_state": record.mission.state},
    )
    await work.save(record)
    return record


def without_doubt(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """The record after its drone has reported about the mission; a changed record is staged."""
    if record.mission.doubt is None:
        return record
    record = replace(
        record,
        mission=record.mission.model_copy(update={"doubt": None}),
        reported_activity=None,
    )
    record = report(work, record, "ACTIVITY", at=work.clock.now())
    work.stage(record)
    return record
