"""Forecasts how much later than promised a package may come: from the last ones, in memory."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from skyway.ids import NetworkId, ProviderId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Database
from skyway_gateway.lateness import store
from skyway_gateway.lateness.calibrate import Arrival, late_share

#: The last packages that count, of a provider in a network and of a whole network. Our own choice.
_MOST_OF_PROVIDER: Final = 300
_MOST_OF_NETWORK: Final = 1_000
#: The most packages of one read. A start reads the last ones of all networks.
_MOST_READ: Final = 5_000
#: Reports may come late. So each read also looks at this much of the time before, fleet and wall
#: seconds.
_LOOK_BACK: Final = (600.0, 30.0)

_Group = tuple[NetworkId | None, ProviderId | None]


@dataclass(slots=True)
class LatenessForecast:
    """The last arrivals by network and provider; `step` reads new ones.

    Each replica reads all arrivals, so all replicas forecast nearly the same.
    """

    db: Database
    clock: FleetClock
    _arrivals: dict[_Group, deque[Arrival]] = field(default_factory=dict)
    _shares: dict[_Group, float | None] = field(default_factory=dict)
    #: The packages of the last read, and the last moment in it.
    _seen: frozenset[tuple[str, str]] = frozenset()
    _last_ms: int = 0

    def late_share(self, network_id: NetworkId | None, provider_id: ProviderId) -> float | None:
        """The share of its planned time by which a package may come later; None if not known.

        It is learned from the provider's packages in this network, or from all packages of the
        network if the provider has too few.
        """
        own = self._share_of((network_id, provider_id))
        return self._share_of((network_id, None)) if own is None else own

    async def step(self) -> bool:
        """Step of a loop: read the packages that have come since the last step. Always False."""
        margin = fleet_margin(self.clock, fleet_s=_LOOK_BACK[0], wall_s=_LOOK_BACK[1])
        since_ms = self._last_ms - round(margin.total_seconds() * 1000)
        async with self.db.read() as connection:
            rows = await store.delivered_since(connection, since_ms, most=_MOST_READ)
        self._note(row for row in rows if _key(row) not in self._seen)
        self._seen = frozenset(_key(row) for row in rows)
        self._last_ms = max((row.delivered_ms for row in rows), default=self._last_ms)
        return False

    def _note(self, rows: Iterable[AnyRow]) -> None:
        for row in rows:
            arrival = _arrival(row)
            for group, most in (
                ((row.network_id, row.provider_id), _MOST_OF_PROVIDER),
                ((row.network_id, None), _MOST_OF_NETWORK),
            ):
                self._arrivals.setdefault(group, deque(maxlen=most)).append(arrival)
                self._shares.pop(group, None)

    def _share_of(self, group: _Group) -> float | None:
        if group not in self._shares:
            self._shares[group] = late_share(self._arrivals.get(group, ()))
        return self._shares[group]


def _key(row: AnyRow) -> tuple[str, str]:
    return row.delivery_id, row.package_id


def _arrival(row: AnyRow) -> Arrival:
    p90_ms = row.promised_p90_ms
    return Arrival(
        planned_s=max(0, row.promised_ms - row.start_ms) / 1000,
        late_s=(row.delivered_ms - row.promised_ms) / 1000,
        was_covered=None if p90_ms is None else row.delivered_ms <= p90_ms,
    )
