"""How much later missions would deliver if a closure were made."""

import asyncio
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

from skyway.ids import ClosureId, MissionId
from skyway_composition.closures.closure import AffectedMission, Closure, ForeseenDelay
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.foresee import Foresight
from skyway_composition.missions.replanning.outlook import MissionOutlook, Rehearsed
from skyway_composition.missions.replanning.situation import Situation

#: For how many missions a dry run plans; operators see how many more there are. Our own choice.
MOST_PLANNED: Final = 20

#: The id of a closure that is not made.
_SUPPOSED: Final = ClosureId("supposed")


async def situations_of(
    work: MissionUnitOfWork, mission_ids: Collection[MissionId]
) -> list[Situation]:
    """The situations of these missions, as far as they are still under way."""
    records = [each for each in work.missions.values() if each.mission_id in mission_ids]
    return [await Situation.of(work, each) for each in records]


async def delays_of(
    foresight: Foresight, seen: Sequence[Rehearsed], closure: Closure
) -> dict[MissionId, ForeseenDelay]:
    """The delay of each mission; all missions are planned at the same time."""
    supposed = (replace(closure, closure_id=_SUPPOSED),)
    outlooks = await asyncio.gather(*(foresight.outlook(each, supposed=supposed) for each in seen))
    ids = [each.before.record.mission_id for each in seen]
    return dict(zip(ids, map(_delay, outlooks), strict=True))


def with_delays(
    missions: Iterable[AffectedMission], delays: Mapping[MissionId, ForeseenDelay]
) -> tuple[AffectedMission, ...]:
    """The missions with the delays that are known."""
    return tuple(
        each.model_copy(update={"delay": delays.get(each.mission_id)}) for each in missions
    )


def _delay(outlook: MissionOutlook) -> ForeseenDelay:
    return ForeseenDelay(
        plan=outlook.plan,
        later_by_s=_later_by_s(outlook),
        code=outlook.code,
        detail=outlook.detail,
    )


def _later_by_s(outlook: MissionOutlook) -> float | None:
    """How much later the last package is delivered; 0 without a package, None if one is not."""
    arrivals = [(each.eta_at, each.new_eta_at) for each in outlook.packages]
    before = [eta_at for eta_at, _ in arrivals if eta_at is not None]
    after = [new_eta_at for _, new_eta_at in arrivals if new_eta_at is not None]
    if not arrivals:
        return 0.0
    if len(after) < len(arrivals) or not before:
        return None
    return (max(after) - max(before)).total_seconds()
