"""The registry's limit is cached for a moment, except before a refusal."""

import asyncio
from datetime import UTC, datetime, timedelta

import pytest
from skyway_gateway.quotes.check_request import CachedPayloadLimits

from skyway.contracts.candidate import PayloadLimit, PayloadLimitQuery
from skyway.contracts.shortlist import CandidateLists, Candidates
from skyway.delivery.qos import ProviderChoice
from skyway.ids import DroneModelId, ProviderId
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable

ANYBODY = ProviderChoice()
PINNED = ProviderChoice(pinned=ProviderId("prv_1"))


class Registry:
    """Counts the questions; it answers once `is_there` is set, or never when it `is_away`."""

    def __init__(self, max_payload_kg: float | None) -> None:
        self.max_payload_kg = max_payload_kg
        self.unknown: tuple[ProviderId, ...] = ()
        self.asked: list[ProviderChoice] = []
        self.is_away = False
        self.is_there = asyncio.Event()
        self.is_there.set()

    async def payload_limit(self, query: PayloadLimitQuery) -> PayloadLimit:
        self.asked.append(query.providers)
        if self.is_away:
            raise ServiceUnavailable("registry", "it is away in this test")
        await self.is_there.wait()
        return self.limit

    @property
    def limit(self) -> PayloadLimit:
        return PayloadLimit(
            max_payload_kg=self.max_payload_kg,
            drone_model_id=DroneModelId("lifter"),
            unknown_provider_ids=self.unknown,
        )

    async def candidates(self, query: object) -> Candidates:
        raise AssertionError(query)

    async def candidate_lists(self, asked: object) -> CandidateLists:
        raise AssertionError(asked)


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(datetime(2026, 3, 1, tzinfo=UTC))


async def test_the_same_choice_is_asked_once_in_two_seconds(clock: ManualClock) -> None:
    registry = Registry(5.0)
    limits = CachedPayloadLimits(registry, clock)

    for _ in range(3):
        assert await limits.limit_for(1.0, ANYBODY) == registry.limit
    await limits.limit_for(1.0, PINNED)
    assert registry.asked == [ANYBODY, PINNED]
    clock.advance(timedelta(seconds=2))
    await limits.limit_for(1.0, ANYBODY)

    assert registry.asked == [ANYBODY, PINNED, ANYBODY]


async def test_a_package_above_the_cached_limit_asks_the_registry_again(clock: ManualClock) -> None:
    registry = Registry(5.0)
    limits = CachedPayloadLimits(registry, clock)
    await limits.limit_for(1.0, ANYBODY)
    registry.max_payload_kg = 9.0

    assert await limits.limit_for(6.0, ANYBODY) == registry.limit


@pytest.mark.parametrize("reason", ["unknown provider", "no fleet", "too heavy"])
async def test_a_refusal_is_not_cached(clock: ManualClock, reason: str) -> None:
    registry = Registry(None if reason == "no fleet" else 5.0)
    registry.unknown = (ProviderId("prv_1"),) if reason == "unknown provider" else ()
    limits = CachedPayloadLimits(registry, clock)
    mass_kg = 6.0 if reason == "too heavy" else 1.0

    await limits.limit_for(mass_kg, ANYBODY)
    await limits.limit_for(mass_kg, ANYBODY)

    assert len(registry.asked) == 2


async def test_there_is_no_limit_while_the_registry_is_away(clock: ManualClock) -> None:
    registry = Registry(5.0)
    limits = CachedPayloadLimits(registry, clock)
    registry.is_away = True

    assert await limits.limit_for(9.0, ANYBODY) is None
    registry.is_away = False
    await limits.limit_for(9.0, ANYBODY)

    assert await limits.limit_for(9.0, ANYBODY) == registry.limit


async def test_only_the_first_request_waits_for_a_registry_that_stands_still(
    clock: ManualClock,
) -> None:
    registry = Registry(5.0)
    limits = CachedPayloadLimits(registry, clock)
    registry.is_there.clear()

    assert await limits.limit_for(9.0, ANYBODY) is None
    asking = [asyncio.create_task(limits.limit_for(9.0, ANYBODY)) for _ in range(20)]
    await asyncio.sleep(0)
    assert [each.done() and each.result() for each in asking] == [None] * 20
    registry.is_there.set()

    async with asyncio.timeout(60):
        while await limits.limit_for(9.0, ANYBODY) is None:  # noqa: ASYNC110 - a task ends it
            await asyncio.sleep(0)
