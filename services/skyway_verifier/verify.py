"""Checks the databases of services: each by its own rules, and all of them together."""

import asyncio
from collections.abc import Mapping
from contextlib import AsyncExitStack
from typing import Final

from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.sql.read_only import ReadOnlyDatabase, Surveyed
from skyway_verifier.across.rules import ACROSS
from skyway_verifier.check import Checked, FactReader, Findings, check
from skyway_verifier.composition.facts import read_facts as composition_facts
from skyway_verifier.composition.rules import RULES as COMPOSITION
from skyway_verifier.cross_rule import service_of
from skyway_verifier.gateway.facts import read_facts as gateway_facts
from skyway_verifier.gateway.rules import RULES as GATEWAY
from skyway_verifier.registry.rules import RULES as REGISTRY
from skyway_verifier.registry.rules import read_facts as registry_facts
from skyway_verifier.rule import Rule

#: The rules of each service's database.
RULES: Final[Mapping[str, tuple[Rule, ...]]] = {
    "registry": REGISTRY,
    "composition": COMPOSITION,
    "gateway": GATEWAY,
}

_FACT_READERS: Final[Mapping[str, FactReader]] = {
    "registry": registry_facts,
    "composition": composition_facts,
    "gateway": gateway_facts,
}

#: How far ahead of this machine's clock the clocks of others may be.
_AHEAD_S: Final = {"fleet_s": 600.0, "wall_s": 30.0}


def checked_as(service: str, db: Surveyed) -> Checked:
    """How a database of this service is checked."""
    return Checked(db, RULES[service], _FACT_READERS[service])


def verify(urls: Mapping[str, str], clock: FleetClock) -> Findings:
    """What is broken in the databases of these URLs, by service, or by `cell_name`.

    Rules across services are left out where a database of one of the two is missing.
    """
    return asyncio.run(_verify(urls, clock))


async def _verify(urls: Mapping[str, str], clock: FleetClock) -> Findings:
    async with AsyncExitStack() as opened:
        checked = {
            name: checked_as(
                service_of(name), await opened.enter_async_context(ReadOnlyDatabase(url))
            )
            for name, url in urls.items()
        }
        fleet_at = clock.now() + fleet_margin(clock, **_AHEAD_S)
        return await check(checked, ACROSS, wall_at=clock.wall_now(), fleet_at=fleet_at)
