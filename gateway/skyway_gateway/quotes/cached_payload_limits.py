"""How heavy a package may be: the registry's word, good for a moment."""

from datetime import timedelta
from typing import Final

from skyway.contracts.candidate import PayloadLimit, PayloadLimitQuery
from skyway.delivery.request import ProviderChoice
from skyway.runtime.clock import FleetClock
from skyway.runtime.remembered import Remembered
from skyway_gateway.clients import Registry

#: How long what was allowed is allowed again unasked, wall time: a fleet hardly shrinks meanwhile,
#: and whether a drone is there is found out by booking.
_KEPT: Final = timedelta(seconds=2)
#: Customers choose providers as they like: what is known is forgotten before it grows large.
_MOST_KNOWN: Final = 1_000


class PayloadLimits:
    """Asks the registry, but not for each request; a refusal is always its present word."""

    def __init__(self, registry: Registry, clock: FleetClock) -> None:
        self._registry = registry
        self._known = Remembered(self._ask, clock=clock, kept=_KEPT, most=_MOST_KNOWN)

    async def limit_for(self, heaviest_kg: float, choice: ProviderChoice) -> PayloadLimit:
        """The limit of the chosen providers' drones, to judge a package of this mass by."""
        known = self._known.answer(choice)
        if known is not None and _allows(known, heaviest_kg):
            return known
        return await self._known.ask(choice)

    async def _ask(self, choice: ProviderChoice) -> PayloadLimit:
        return await self._registry.payload_limit(PayloadLimitQuery(providers=choice))


def _allows(limit: PayloadLimit, heaviest_kg: float) -> bool:
    if limit.unknown_provider_ids or limit.max_payload_kg is None:
        return False
    return heaviest_kg <= limit.max_payload_kg
