"""Takes packages out of a QUEUED mission; its drone was never instructed, so this is safe."""

from collections.abc import Collection

from skyway.ids import PackageId
from skyway_composition.missions.mission.end import cancel_queued, refuse
from skyway_composition.missions.mission.notify import report
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork


async def release_queued(
    work: MissionUnitOfWork,
    record: MissionRecord,
    package_ids: Collection[PackageId],
    *,
    code: str,
    reason: str,
) -> tuple[PackageId, ...]:
    """Leave these packages of a QUEUED mission at the pickup; returns those that it has.

    With other packages left the mission is refused, so that the gateway books a plan for these.
    """
    own = tuple(each.package_id for each in record.packages(frozenset(package_ids)))
    if not own:
        return ()
    record = report(
        work,
        record,
        "RELEASED",
        at=work.clock.now(),
        package_ids=own,
        code=code,
        detail=reason,
    )
    left = len(record.request.packages) - len(own)
    if left:
        detail = f"planned again for the other {left} packages: {reason}"
        await refuse(work, record, code=code, detail=detail)
    else:
        await cancel_queued(work, record, code=code, detail=reason)
    return own
