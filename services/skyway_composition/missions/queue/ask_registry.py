"""What those who plan queues ask the registry about drones and their providers."""

from collections.abc import Collection, Mapping

from skyway.contracts.candidate import CANDIDATE_LISTS, CandidateQueries, CandidateQuery
from skyway.contracts.drones import (
    EXCHANGING,
    MOST_DRONES,
    OUT_OF_SERVICE,
    ExchangingProviders,
    OutOfServiceAnswer,
    OutOfServiceQuery,
)
from skyway.contracts.shortlist import CandidateLists, Shortlist
from skyway.delivery.offer import Tariff
from skyway.ids import DroneId, ProviderId
from skyway.runtime.http.client import ServiceClient


async def out_of_service(
    registry: ServiceClient, drone_ids: Collection[DroneId]
) -> OutOfServiceAnswer:
    """Which of these drones get no missions any more; at most MOST_DRONES in one question."""
    listed, answers = [*drone_ids], list[OutOfServiceAnswer]()
    for first in range(0, len(listed), MOST_DRONES):
        asked = OutOfServiceQuery(drone_ids=tuple(listed[first : first + MOST_DRONES]))
        found = await registry.call("POST", OUT_OF_SERVICE, body=asked, answer=OutOfServiceAnswer)
        answers.append(found)
    return OutOfServiceAnswer(
        drone_ids=tuple(one for each in answers for one in each.drone_ids),
        due_drone_ids=tuple(one for each in answers for one in each.due_drone_ids),
    )


async def exchanging_tariffs(registry: ServiceClient) -> Mapping[ProviderId, Tariff]:
    """The tariffs of all providers that exchange deliveries now."""
    return (await registry.call("GET", EXCHANGING, answer=ExchangingProviders)).tariffs


async def shortlists_for(
    registry: ServiceClient, queries: tuple[CandidateQuery, ...]
) -> tuple[Shortlist, ...]:
    """The candidates of each of these requests; at most MOST_QUERIES in one question."""
    asked = CandidateQueries(queries=queries)
    found = await registry.call("POST", CANDIDATE_LISTS, body=asked, answer=CandidateLists)
    return tuple(each.shortlist for each in found.answers)
