"""The last missions of a provider in a network: where its next pickup is expected.

Only the provider's own missions count. So the ways of its drones show nothing about the requests of
other providers.
"""

import asyncio
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Final

from sqlalchemy import Integer, Select, and_, bindparam, select

from skyway.contracts.mission import OPEN_MISSION_STATES
from skyway.ids import DroneId, NetworkId, ProviderId, StationId
from skyway.network.network import Network
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway.scheduling.repositioning import PastRequest, expected_pickups
from skyway.scheduling.standby import StandbyChoice
from skyway.scheduling.stays import read_stays
from skyway_composition.tables import mission_steps, missions

#: So many of a provider's missions are read, those that were booked last. Our own choice.
_MOST_MISSIONS: Final = 500

#: They are found among so many last missions of the provider in all networks, so that a provider
#: with many missions elsewhere does not slow a booking down. Our own choice.
_MOST_LOOKED_AT: Final = 5_000

#: How long the missions of a provider are cached, wall time, and for how many providers. Our own
#: choices.
_KEPT: Final = timedelta(seconds=5)

_MOST_PROVIDERS: Final = 1_000

#: So many of the last missions, and all newer ones, are read at each choice of a place. Our own
#: choice: one replica may save a mission a moment after another replica has saved a newer one.
_MOST_READ_AGAIN: Final = 20

_OF_PROVIDER: Final = select(
    missions.c.mission_id,
    missions.c.network_id,
    missions.c.delivery_id,
    missions.c.drone_id,
    missions.c.state,
    missions.c.start_ms,
    missions.c.stays,
).where(missions.c.provider_id == bindparam("provider_id"))

_anywhere: Final = (
    _OF_PROVIDER
    # Mission ids are sorted by time.
    .order_by(missions.c.mission_id.desc())
    .limit(bindparam("most_looked_at", type_=Integer))
    .subquery("anywhere")
)
_LAST: Final = (
    select(_anywhere, mission_steps.c.station_id)
    .join(
        mission_steps,
        and_(
            mission_steps.c.mission_id == _anywhere.c.mission_id,
            mission_steps.c.kind == "PICK_UP",
        ),
    )
    .where(_anywhere.c.network_id == bindparam("network_id"))
    .order_by(_anywhere.c.mission_id.desc())
    .limit(_MOST_MISSIONS)
)

_NEWEST: Final = (
    _OF_PROVIDER.where(
        missions.c.mission_id >= bindparam("since"),
        missions.c.network_id == bindparam("network_id"),
    )
    .order_by(missions.c.mission_id.desc())
    .limit(_MOST_MISSIONS)
)

#: After a mission in one of these states its drone waits where the mission has planned.
_WAITS_AFTER: Final = frozenset({*OPEN_MISSION_STATES, "COMPLETED"})


@dataclass(frozen=True, slots=True)
class _Past:
    """A provider's last requests, and its last missions, the newest first."""

    requests: tuple[PastRequest, ...]
    missions: Sequence[Any]  # rows

    @property
    def since(self) -> str:
        """The id of the oldest mission that is read again; empty if all are read again."""
        again = self.missions[:_MOST_READ_AGAIN]
        return again[-1].mission_id if len(again) == _MOST_READ_AGAIN else ""


class PastPickups:
    """The last missions in one network: requests a few seconds old, and where drones wait now."""

    def __init__(
        self,
        db: Database,
        clock: FleetClock,
        network_id: NetworkId,
        *,
        most_looked_at: int = _MOST_LOOKED_AT,
    ) -> None:
        self._db = db
        self.network_id = network_id
        self._most_looked_at = most_looked_at
        self._past = AnswerCache(self._read, clock=clock, kept=_KEPT, most=_MOST_PROVIDERS)

    async def with_places(
        self, choice: StandbyChoice, network: Network, *, start: StationId, at_ms: int
    ) -> StandbyChoice:
        """The choice with the places near the next pickup, for a standby that begins at `start`.

        `network` is the network as the drone sees it. For other settings than NEXT_PICKUP the
        choice stays as it is.
        """
        if choice.drone is None:
            return choice
        provider_id, drone_id = choice.drone
        past = self._past.cached(provider_id)
        if past is None:
            past = await self._past.ask(provider_id)
        # Of the cached missions that are read again, some have changed, and some are deleted.
        newest = await self._rows(_NEWEST, provider_id, since=past.since)
        older = [each for each in past.missions if each.mission_id < past.since]
        waits_at = _waits_at([*newest, *older])
        waiting = Counter(at for each, at in waits_at.items() if each != drone_id)
        pickups = expected_pickups(past.requests, at_ms=at_ms)
        # Comparing takes tens of milliseconds, and a booking does it for each of its drones.
        return await asyncio.to_thread(choice.near, pickups, network, start=start, waiting=waiting)

    async def _read(self, provider_id: ProviderId) -> _Past:
        rows = await self._rows(_LAST, provider_id, most_looked_at=self._most_looked_at)
        return _Past(tuple(_requests(rows)), rows)

    async def _rows(
        self, query: Select[Any], provider_id: ProviderId, **values: Any
    ) -> Sequence[Any]:
        of = {"provider_id": provider_id, "network_id": self.network_id}
        async with self._db.read() as connection:
            rows: Sequence[Any] = (await connection.execute(query, of | values)).all()
        return rows


def _requests(rows: Sequence[Any]) -> Iterator[PastRequest]:
    """The requests of these missions; a request that was booked several times counts once."""
    seen = set[str]()
    for row in rows:
        if row.delivery_id not in seen:
            seen.add(row.delivery_id)
            yield PastRequest(StationId(row.station_id), row.start_ms)


def _waits_at(rows: Sequence[Any]) -> dict[DroneId, StationId]:
    """Where each drone waits after the last of these missions."""
    last: dict[DroneId, Any] = {}  # rows
    for row in sorted(rows, key=lambda each: each.start_ms):
        if row.state in _WAITS_AFTER:
            last[DroneId(row.drone_id)] = row
    return {each: read_stays(row.stays)[-1].station_id for each, row in last.items() if row.stays}
