"""Missions that wait for better weather, or for the end of a closure, go on as soon as they may.

A plan waits until the moment that was known when it was made. When the conditions of its network
have changed, a mission that waits is planned again, and gets the new plan if it serves sooner.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from functools import partial
from typing import Final

from skyway.contracts.flight_step import DeliverStep, FlightStep, ReturnStep
from skyway.ids import DroneId
from skyway.runtime.sql.database import Tx
from skyway_composition.calendar.attempts import Change, commit
from skyway_composition.context import Context
from skyway_composition.missions.mission.record import Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.find_plan import (
    NewPlan,
    NoPlanYet,
    PlanFinder,
    trouble_of,
)
from skyway_composition.missions.replanning.propose import Revision, propose, revision_of
from skyway_composition.missions.replanning.situation import read_situation
from skyway_composition.missions.replanning.store import Waiting, waiting

#: A shorter wait, or a smaller gain, is not worth another plan. Our own choice.
_LONG_WAIT: Final = timedelta(minutes=10)
_WORTH: Final = timedelta(minutes=1)

_WHY: Final = Trouble(
    code="CONDITIONS_CHANGED",
    detail="the weather or a closure has changed, so the drone need not wait so long",
)


@dataclass(slots=True)
class WaitingMissions:
    """Plans again for missions that wait when the conditions of their networks have changed."""

    context: Context
    _planned: frozenset[Waiting] = field(default_factory=frozenset)

    async def step(self) -> bool:
        """Plan for each waiting mission that was not planned for in the present conditions.

        A mission that cannot be planned because of an error does not keep the others waiting.
        """
        async with self.context.db.read() as connection:
            found = await waiting(connection, at_ms=self.context.now_ms, for_=_LONG_WAIT)
        self._planned &= found
        failures: list[Exception] = []
        for each in sorted(found - self._planned):
            try:
                if await self._go_sooner(each.drone_id):
                    self._planned |= {each}
            except Exception as error:  # noqa: BLE001 - raised below
                failures.append(error)
        if failures:
            raise ExceptionGroup("waiting missions not planned", failures)
        return False

    async def _go_sooner(self, drone_id: DroneId) -> bool:
        """Send another plan if it serves sooner; False if this must be tried again."""
        seen = await read_situation(self.context, drone_id)
        if seen is None or trouble_of(seen.record) is not None:
            return True
        record = replace(seen.record, trouble=_WHY)
        found = await PlanFinder(self.context).find(replace(seen, record=record))
        if not isinstance(found, NewPlan) or found.remainder.given_up is not None:
            return not isinstance(found, NoPlanYet)
        revision = revision_of(found, record, seen.link, clock=self.context.clock)
        is_sooner = _served_at(revision.steps) + _WORTH <= _served_at(seen.planned)
        if revision.aims != record.aims or not is_sooner:
            return True
        write = partial(self._send, plan=found, revision=revision)
        return await commit(self.context, Change(found.remainder.trip.start_ms, write)) is None

    async def _send(self, tx: Tx, *, plan: NewPlan, revision: Revision) -> None:
        work = await MissionUnitOfWork.lock_as_seen(self.context, tx, plan.case.seen)
        record = work.missions[plan.case.record.drone_id]
        await propose(work, record, revision, anchor=plan.anchor, trouble=_WHY)


def _served_at(steps: Sequence[FlightStep]) -> datetime:
    """When the last package is handed over by these steps; without any, when the last step ends."""
    hand_overs = [each for each in steps if isinstance(each, DeliverStep | ReturnStep)]
    return max(each.planned_end_at for each in hand_overs or steps)
