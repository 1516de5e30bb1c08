"""How much later than planned a package may come, learned from the last packages."""

import math
from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final, NamedTuple

from skyway.contracts.mission import DeliveryMission
from skyway.contracts.quote import OfferTerms
from skyway.delivery.lateness import (
    UNKNOWN,
    Conditions,
    ConditionsGroup,
    PackageArrival,
    late_share,
    later_by_s,
)
from skyway.delivery.request import DeliveryRequest
from skyway.ids import NetworkId, PackageId, ProviderId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Database
from skyway_gateway.lateness import store
from skyway_gateway.lateness.store import MOST_OF_PROVIDER

#: The most packages of one read. A start reads more: the last ones of each provider in each network
#: may have come before many packages of other providers. Our own choice.
_MOST_READ: Final = 5_000
_MOST_AT_START: Final = 50_000
#: Reports may come late. So each read also looks at this much of the time before, fleet and wall
#: seconds.
_LOOK_BACK: Final = (600.0, 30.0)

_Providers = dict[ProviderId, deque[PackageArrival]]
_Listed = dict[ProviderId, list[PackageArrival]]


def _no_arrivals() -> deque[PackageArrival]:
    return deque(maxlen=MOST_OF_PROVIDER)


def _no_providers() -> _Providers:
    return defaultdict(_no_arrivals)


class Covered(NamedTuple):
    """A number of packages that had a P90, and how many of them came by then."""

    packages: int
    in_time: int


@dataclass(slots=True)
class LatenessForecast:
    """The last arrivals of each provider in each network; `step` reads new ones.

    Each replica reads all arrivals, so all replicas find nearly the same lateness.
    """

    db: Database
    clock: FleetClock
    _arrivals: dict[NetworkId | None, _Providers] = field(
        default_factory=lambda: defaultdict(_no_providers)
    )
    #: The same of packages whose customers allow more lateness. The dispatcher may have planned
    #: them later, so they count only if too few others have come.
    _allowing: dict[NetworkId | None, _Providers] = field(
        default_factory=lambda: defaultdict(_no_providers)
    )
    #: The packages of the last read, and the last moment in it.
    _seen: frozenset[tuple[str, str]] = frozenset()
    _last_ms: int = 0

    def late_share(
        self,
        network_id: NetworkId | None,
        provider_id: ProviderId,
        plans: Sequence[Conditions] = (UNKNOWN,),
    ) -> float | None:
        """The lateness that nine of ten packages do not exceed, as a share of the planned time.

        It is learned from the provider's packages in this network, for the one of these plans whose
        packages come latest. A provider with few packages borrows from the other providers of the
        network. If too few packages have come, it is what the plans say about the wind. None if it
        is not known.
        """
        strict = _by_provider(self._arrivals.get(network_id, {}))
        learned = _share_of(provider_id, strict, plans)
        if learned is None:
            every = _by_provider(self._allowing.get(network_id, {}))
            for name, arrivals in strict.items():
                every[name] = [*every.get(name, ()), *arrivals]
            learned = _share_of(provider_id, every, plans)
        if learned is not None:
            return learned
        return max((each.late_share for each in plans if each.late_share), default=None)

    def coverage(self, provider_id: ProviderId | None = None) -> dict[ConditionsGroup, Covered]:
        """How the P90s of the last packages were kept, by what was known when they were promised.

        Of one provider, or of all without an id.
        """
        found: dict[ConditionsGroup, list[bool]] = defaultdict(list)
        for providers in self._arrivals.values():
            for name, arrivals in providers.items():
                for each in arrivals if provider_id in (None, name) else ():
                    if each.was_covered is not None:
                        found[each.known.group].append(each.was_covered)
        return {group: Covered(len(each), sum(each)) for group, each in found.items()}

    async def step(self) -> bool:
        """Step of a loop: read the packages that have come since the last step. Always False."""
        margin = fleet_margin(self.clock, fleet_s=_LOOK_BACK[0], wall_s=_LOOK_BACK[1])
        since_ms = self._last_ms - round(margin.total_seconds() * 1000)
        most = _MOST_READ if self._seen else _MOST_AT_START
        async with self.db.read() as connection:
            rows = await store.delivered_since(connection, since_ms, most=most)
        self._note(row for row in rows if _key(row) not in self._seen)
        self._seen = frozenset(_key(row) for row in rows)
        self._last_ms = max((row.delivered_ms for row in rows), default=self._last_ms)
        return False

    def _note(self, rows: Iterable[AnyRow]) -> None:
        for row in rows:
            arrivals = self._allowing if row.allows_more else self._arrivals
            arrivals[row.network_id][row.provider_id].append(_arrival(row))


def _by_provider(providers: _Providers) -> _Listed:
    return {name: [*each] for name, each in providers.items()}


def _share_of(
    provider_id: ProviderId, arrivals: _Listed, plans: Iterable[Conditions]
) -> float | None:
    own = arrivals.get(provider_id, [])
    others = [each for name, each in arrivals.items() if name != provider_id]
    shares = (late_share(known, own, others) for known in plans)
    return max((each for each in shares if each is not None), default=None)


def conditions_of(mission: DeliveryMission) -> Conditions:
    """What is known about a mission when it is booked."""
    margins = mission.margins
    return Conditions.of_plan(mission.plan, margins.air, margins.late_share)


def conditions_of_offer(terms: OfferTerms) -> Conditions:
    """The same about the trips of an offer, each with an equal part of its recharges."""
    margins, trips = terms.margins, max(1, terms.trips)
    return Conditions.of(
        margins.air,
        margins.late_share,
        planned_s=terms.delivery_time_s,
        recharges=math.ceil(terms.recharges / trips),
        recharging_s=terms.recharging_s / trips,
    )


def _key(row: AnyRow) -> tuple[str, str]:
    return row.delivery_id, row.package_id


def _arrival(row: AnyRow) -> PackageArrival:
    p90_ms = row.promised_p90_ms
    return PackageArrival(
        planned_s=max(0, row.promised_ms - row.start_ms) / 1000,
        late_s=(row.delivered_ms - row.promised_ms) / 1000,
        # A package that the dispatcher may plan later says nothing about the promise.
        was_covered=None if p90_ms is None or row.allows_more else row.delivered_ms <= p90_ms,
        known=UNKNOWN if row.promised_on is None else Conditions.read(row.promised_on),
    )


#: What messages and programs may take, wall seconds. In a simulation whose time runs faster than
#: that of the machine this looks like lateness of drones.
_HOST_TAKES_S: Final = 5.0


def host_delay(clock: FleetClock) -> timedelta:
    """The lateness in fleet time that the machine alone may have caused; nothing in real time."""
    return timedelta(seconds=_HOST_TAKES_S * max(0.0, clock.rate - 1.0))


def host_delay_ms(clock: FleetClock) -> int:
    """`host_delay` in milliseconds of fleet time."""
    return round(host_delay(clock) / timedelta(milliseconds=1))


def p90_of(eta_at: datetime, *, start_at: datetime, share: float | None) -> datetime | None:
    """The P90 of a package that is planned to come at `eta_at`; None if no share is known."""
    if share is None:
        return None
    planned_s = (eta_at - start_at).total_seconds()
    return eta_at + timedelta(seconds=later_by_s(planned_s, share))


def due_of(
    package_id: PackageId, eta_at: datetime, p90_at: datetime | None, request: DeliveryRequest
) -> datetime:
    """The promise from which lateness counts: the P90 if asked and known, else the ETA.

    It is later by what the customer allows, or the end of the package's window.
    """
    promised_at = p90_at if p90_at is not None and request.qos.promise == "P90" else eta_at
    return request.kept_until(package_id, promised_at)
