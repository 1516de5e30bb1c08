"""The loop that commits what a cause proposes, or lets the cause propose again."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
from skyway_composition.calendar.attempts import Change, Lost, Settled, carry_out, commit
from skyway_composition.calendar.commit import WorldChanged
from skyway_composition.calendar.store import calendar_versions, raise_versions
from skyway_composition.missions.mission.store import add_delivery

from skyway.ids import DeliveryId, DroneId
from skyway.runtime.errors import RowRefused
from skyway.runtime.sql.database import Tx
from skyway.units import NEVER_MS

pytestmark = pytest.mark.databases("sqlite")

DRONE = DroneId("drn_1")


@dataclass(slots=True)
class Proposals:
    """A cause that proposes these writes one after another, and notes what it learns."""

    writes: list[Callable[[Tx], Awaitable[str]]]
    learned: list[Lost | None] = field(default_factory=list)

    async def propose(self, lost: Lost | None) -> Change[str] | Settled[str]:
        self.learned.append(lost)
        return Change(NEVER_MS, self.writes.pop(0)) if self.writes else Settled("settled")


async def done(tx: Tx) -> str:
    await raise_versions(tx, [DRONE])
    return "done"


async def changed(tx: Tx) -> str:
    await done(tx)
    raise WorldChanged([DRONE])


async def refused(tx: Tx) -> str:
    add_delivery(tx, DeliveryId("dlv_1"))
    return await done(tx)


async def number(composition: Any) -> int:
    async with composition.db.read() as connection:
        return (await calendar_versions(connection, [DRONE]))[DRONE]


async def test_a_cause_learns_why_its_last_change_was_lost(composition: Any) -> None:
    await composition.book()
    before, cause = await number(composition), Proposals([changed, done])

    assert await carry_out(composition.parts, cause) == "done"

    first, lost = cause.learned
    assert first is None
    assert isinstance(lost, WorldChanged)
    assert lost.drones == {DRONE}
    # The change that was lost has left nothing behind.
    assert await number(composition) == before + 1


async def test_a_change_that_the_database_refuses_is_proposed_again(composition: Any) -> None:
    await composition.book()
    cause = Proposals([refused, done])

    assert await carry_out(composition.parts, cause) == "done"

    assert isinstance(cause.learned[-1], RowRefused)


async def test_a_cause_that_has_settled_writes_nothing(composition: Any) -> None:
    await composition.book()
    before = await number(composition)

    assert await carry_out(composition.parts, Proposals([changed])) == "settled"

    assert await number(composition) == before


async def test_a_change_is_committed_until_its_last_moment_and_not_after_it(
    composition: Any,
) -> None:
    await composition.book()
    now_ms = composition.parts.now_ms

    assert await commit(composition.parts, Change(now_ms, done)) == "done"
    late = await commit(composition.parts, Change(now_ms - 1, done))

    assert isinstance(late, WorldChanged)
    assert late.drones == frozenset()
