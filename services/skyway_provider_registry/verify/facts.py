"""What the registry says of drones and their missions, for composition's facts to be compared."""

from collections.abc import AsyncIterator
from typing import Final

from sqlalchemy import select

from skyway.contracts.service_facts import AnyFacts, DroneFacts, HintFacts, ProviderFacts
from skyway.runtime.verification.fact_files import FactReader
from skyway.runtime.verification.survey import Survey
from skyway_provider_registry.tables import drones, mission_hints, providers


async def _hints(survey: Survey) -> AsyncIterator[AnyFacts]:
    async for row in survey.each(select(mission_hints)):
        yield HintFacts(
            mission_id=row.mission_id,
            drone_id=row.drone_id,
            state=row.mission_state,
            is_live=row.is_live,
            report_seq=row.seq,
        )


async def _drones(survey: Survey) -> AsyncIterator[AnyFacts]:
    async for row in survey.each(select(drones.c.drone_id, drones.c.provider_id)):
        yield DroneFacts(drone_id=row.drone_id, provider_id=row.provider_id)


async def _providers(survey: Survey) -> AsyncIterator[AnyFacts]:
    async for row in survey.each(select(providers.c.provider_id)):
        yield ProviderFacts(provider_id=row.provider_id)


FACTS: Final[dict[str, FactReader]] = {"hints": _hints, "drones": _drones, "providers": _providers}
