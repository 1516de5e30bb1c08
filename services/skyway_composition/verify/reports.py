"""The rules of the outbox: reports to other services are whole and in order."""

from collections import defaultdict
from collections.abc import Mapping
from typing import Final

from sqlalchemy import select

from skyway.contracts.mission_reports import MissionReport
from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.survey import Survey
from skyway_composition.tables import missions, outbox

_RESTORE: Final = (
    "A row of `outbox` was deleted or changed. The gateway waits for the report with the next "
    "`seq`: restore the row from a backup, or cancel the mission and settle its delivery by hand."
)

#: The services that get reports.
_RECEIVERS: Final = ("gateway", "registry")


async def _waiting(survey: Survey) -> Mapping[tuple[str, str], list[int]]:
    """By service and mission: the numbers of the reports that wait in the outbox, in order."""
    waiting: dict[tuple[str, str], list[int]] = defaultdict(list)
    query = select(outbox).where(outbox.c.channel.in_(_RECEIVERS)).order_by(outbox.c.id)
    async for row in survey.each(query):
        report = MissionReport.read(row.payload)
        number = report.seq if report.mission_id == row.stream else -1
        waiting[row.channel, row.stream].append(number)
    return waiting


async def _with_gaps(survey: Survey) -> set[str]:
    query = select(missions.c.mission_id, missions.c.report_seq)
    last = {row.mission_id: row.report_seq for row in await survey.rows(query)}
    return {
        mission_id
        for (service, mission_id), numbers in (await survey.once(_waiting)).items()
        if not _is_whole(numbers, last.get(mission_id, 0), is_gapless=service == "gateway")
    }


def _is_whole(numbers: list[int], last: int, *, is_gapless: bool) -> bool:
    """Whether these are the last reports of a mission; the registry gets only some of them."""
    if is_gapless:
        return numbers == list(range(last - len(numbers) + 1, last + 1))
    return numbers == sorted(set(numbers)) and numbers[0] > 0 and numbers[-1] <= last


REPORTS: Final = (Rule("a mission's waiting reports are its last ones", _with_gaps, _RESTORE),)
