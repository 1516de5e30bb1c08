"""Puts a mission in doubt when it is unknown what its drone has done, and ends the doubt.

A mission in doubt keeps its drone, its pads and its packages. So no second drone gets the packages
while the first drone may have them, or may have delivered them.
"""

from dataclasses import replace
from typing import Any, Final, Literal

from skyway.contracts.mission import Doubt
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, raise_alarm, report

#: A doubt is replaced only by one with a larger number.
_WEIGHTS: Final = {"NO_ANSWER": 0, "SILENT": 0, "JOURNAL_LOST": 1, "IMPLAUSIBLE": 2}

#: What the mission waits for: after plausible reports, and after impossible reports.
_WAITS: Final = (
    "the mission waits until the drone reports or an operator gives it up",
    "the mission waits until an operator gives it up; reports of the drone change nothing",
)


def is_disbelieved(record: MissionRecord) -> bool:
    """Whether the drone has reported what cannot have happened."""
    doubt = record.mission.doubt
    return doubt is not None and doubt.code == "IMPLAUSIBLE"


async def put_in_doubt(
    work: MissionUnitOfWork,
    record: MissionRecord,
    *,
    code: Literal["NO_ANSWER", "SILENT", "JOURNAL_LOST", "IMPLAUSIBLE"],
    detail: str,
    data: dict[str, Any] | None = None,
) -> MissionRecord:
    """The record in doubt, saved; operators get an alarm, with `data`, and the customer a report.

    The first reason stays, unless the new reason says more: with JOURNAL_LOST the drone itself does
    not know what it did before, and with IMPLAUSIBLE its reports cannot be true.
    """
    earlier = record.mission.doubt
    if earlier is not None and _WEIGHTS[earlier.code] >= _WEIGHTS[code]:
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
        detail=f"{detail}; {_WAITS[code == 'IMPLAUSIBLE']}",
        data={"doubt": code, "mission_state": record.mission.state, **(data or {})},
    )
    await work.save(record)
    return record


def without_doubt(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """The record after its drone has reported about the mission; a changed record is staged.

    A mission with impossible reports stays in doubt.
    """
    if record.mission.doubt is None or is_disbelieved(record):
        return record
    record = replace(
        record,
        mission=record.mission.model_copy(update={"doubt": None}),
        reported_activity=None,
    )
    record = report(work, record, "ACTIVITY", at=work.clock.now())
    work.stage(record)
    return record
