"""How heavy a package may be: the registry's answer, cached for a moment."""

from datetime import timedelta
from typing import Final

from skyway.contracts.candidate import PayloadLimit, PayloadLimitQuery
from skyway.delivery.request import ProviderChoice
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway_gateway.clients import Registry

#: How long a limit is used without asking again, wall time. Fleets hardly change meanwhile, and
#: booking finds out whether a drone is available.
_KEPT: Final = timedelta(seconds=2)
#: The most limits that are cached: each choice of providers has its own.
_MOST_CACHED: Final = 1_000


class CachedPayloadLimits:
    """Payload limits from the registry; only a fresh limit refuses a package."""

    def __init__(self, registry: Registry, clock: FleetClock) -> None:
        self._registry = registry
        self._cached = AnswerCache(self._ask, clock=clock, kept=_KEPT, most=_MOST_CACHED)

    async def limit_for(self, heaviest_kg: float, choice: ProviderChoice) -> PayloadLimit:
        """The payload limit of the chosen providers' drones, fresh if this mass might exceed it."""
        cached = self._cached.cached(choice)
        if cached is not None and _allows(cached, heaviest_kg):
            return cached
        return await self._cached.ask(choice)

    async def _ask(self, choice: ProviderChoice) -> PayloadLimit:
        return await self._registry.payload_limit(PayloadLimitQuery(providers=choice))


def _allows(limit: PayloadLimit, heaviest_kg: float) -> bool:
    if limit.unknown_provider_ids or limit.max_payload_kg is None:
        return False
    return heaviest_kg <= limit.max_payload_kg
