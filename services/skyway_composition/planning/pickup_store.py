"""The last missions of a provider in a network: where its next pickup is expected.

Only the provider's own missions count. So the ways of its drones show nothing about the requests of
other providers.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from sqlalchemy import and_, bindparam, select

from skyway.contracts.mission import OPEN_MISSION_STATES
from skyway.ids import DroneId, NetworkId, ProviderId, StationId
from skyway.network.network import Network
from skyway.runtime.sql.database import Database
from skyway.scheduling.repositioning import PastRequest, expected_pickups
from skyway.scheduling.standby import StandbyChoice
from skyway.scheduling.stays import read_stays
from skyway_composition.tables import mission_steps, missions

#: So many missions are read, the last that were booked. Our own choice.
_MOST_MISSIONS: Final = 500

_LAST: Final = (
    select(
        missions.c.delivery_id,
        missions.c.drone_id,
        missions.c.state,
        missions.c.start_ms,
        missions.c.stays,
        mission_steps.c.station_id,
    )
    .join(
        mission_steps,
        and_(
            mission_steps.c.mission_id == missions.c.mission_id,
            mission_steps.c.kind == "PICK_UP",
        ),
    )
    .where(
        missions.c.provider_id == bindparam("provider_id"),
        missions.c.network_id == bindparam("network_id"),
    )
    # Mission ids are sorted by time.
    .order_by(missions.c.mission_id.desc())
    .limit(_MOST_MISSIONS)
)

#: After a mission in one of these states its drone waits where the mission has planned.
_WAITS_AFTER: Final = frozenset({*OPEN_MISSION_STATES, "COMPLETED"})

Rows = list[Any]  # rows of `_LAST`, whose columns have any type


@dataclass(frozen=True, slots=True)
class PastPickups:
    """The last missions in one network; those of each provider are read once."""

    db: Database
    network_id: NetworkId
    _read: dict[ProviderId, Rows] = field(default_factory=dict)

    async def with_places(
        self, choice: StandbyChoice, network: Network, *, start: StationId, at_ms: int
    ) -> StandbyChoice:
        """The choice with the places near the next pickup, for a standby that begins at `start`.

        `network` is the network as the drone sees it. Other settings than NEXT_PICKUP stay.
        """
        if choice.drone is None:
            return choice
        provider_id, drone_id = choice.drone
        rows = await self._rows(provider_id)
        pickups = expected_pickups(_requests(rows), at_ms=at_ms)
        return choice.near(pickups, network, start=start, waiting=_waiting(rows, drone_id))

    async def _rows(self, provider_id: ProviderId) -> Rows:
        rows = self._read.get(provider_id)
        if rows is None:
            values = {"provider_id": provider_id, "network_id": self.network_id}
            async with self.db.read() as connection:
                rows = [*(await connection.execute(_LAST, values)).all()]
            self._read[provider_id] = rows
        return rows


def _requests(rows: Rows) -> Iterator[PastRequest]:
    """The requests of these missions; a request that was booked several times counts once."""
    seen = set[str]()
    for row in rows:
        if row.delivery_id not in seen:
            seen.add(row.delivery_id)
            yield PastRequest(StationId(row.station_id), row.start_ms)


def _waiting(rows: Rows, drone_id: DroneId) -> Counter[StationId]:
    """How many other drones wait at each station, or will after their last mission."""
    last: dict[str, Any] = {}  # rows
    for row in rows:
        is_later = row.drone_id not in last or last[row.drone_id].start_ms < row.start_ms
        if row.state in _WAITS_AFTER and row.drone_id != drone_id and is_later:
            last[row.drone_id] = row
    return Counter(read_stays(row.stays)[-1].station_id for row in last.values() if row.stays)
