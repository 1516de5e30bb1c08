"""How heavy a package may be: the registry's word, good for a moment."""

from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.candidate import PayloadLimit, PayloadLimitQuery
from skyway.delivery.request import ProviderChoice
from skyway.runtime.clock import FleetClock
from skyway_gateway.clients import Registry

#: How long what was allowed is allowed again unasked, wall time: a fleet hardly shrinks meanwhile,
#: and whether a drone is there is found out by booking.
_KEPT: Final = timedelta(seconds=2)
#: Customers choose providers as they like: what is known is forgotten before it grows large.
_MOST_KNOWN: Final = 1_000


@dataclass(frozen=True, slots=True)
class PayloadLimits:
    """Asks the registry, but not for each request; a refusal is always its present word."""

    registry: Registry
    clock: FleetClock
    _known: dict[ProviderChoice, tuple[datetime, PayloadLimit]] = field(default_factory=dict)

    async def limit_for(self, heaviest_kg: float, choice: ProviderChoice) -> PayloadLimit:
        """The limit of the chosen providers' drones, to judge a package of this mass by."""
        now = self.clock.wall_now()
        asked_at, known = self._known.get(choice, (now, None))
        if known is not None and now - asked_at < _KEPT and _allows(known, heaviest_kg):
            return known
        limit = await self.registry.payload_limit(PayloadLimitQuery(providers=choice))
        if len(self._known) >= _MOST_KNOWN:
            self._known.clear()
        if _allows(limit, heaviest_kg):
            self._known[choice] = (now, limit)
        return limit


def _allows(limit: PayloadLimit, heaviest_kg: float) -> bool:
    if limit.unknown_provider_ids or limit.max_payload_kg is None:
        return False
    return heaviest_kg <= limit.max_payload_kg
