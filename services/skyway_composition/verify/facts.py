"""What composition says of deliveries, missions and drones, for other services to compare."""

import json
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Mapping
from typing import Any, Final

from sqlalchemy import func, select

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.contracts.service_facts import (
    AnyFacts,
    CustodyLink,
    DeliveryFacts,
    DroneFacts,
    HintFacts,
    MissionFacts,
    PackageFacts,
)
from skyway.delivery.offer import Price
from skyway.runtime.verification.fact_files import FactReader
from skyway.runtime.verification.rule import Survey
from skyway_composition.tables import custody, deliveries, is_live, missions, outbox


async def _deliveries(survey: Survey) -> AsyncIterator[AnyFacts]:
    flown, chains = await survey.once(_missions_by_delivery), await _chains(survey)
    async for row in survey.each(select(deliveries)):
        yield DeliveryFacts(
            delivery_id=row.delivery_id,
            is_over=row.closed_ms is not None,
            missions=tuple(flown.get(row.delivery_id, ())),
            packages=tuple(
                PackageFacts(package_id=package_id, chain=tuple(chain))
                for package_id, chain in chains.get(row.delivery_id, {}).items()
            ),
        )


async def _missions_by_delivery(survey: Survey) -> Mapping[str, list[MissionFacts]]:
    waiting = await _waiting(survey, "gateway")
    found: dict[str, list[MissionFacts]] = defaultdict(list)
    async for row in survey.each(select(missions)):
        found[row.delivery_id].append(
            MissionFacts(
                mission_id=row.mission_id,
                attempt=row.attempt,
                trip=row.trip,
                provider_id=row.provider_id,
                drone_id=row.drone_id,
                # The gateway is not notified when a mission is sent.
                state="BOOKED" if row.state == "QUEUED" else row.state,
                price=Price.model_validate(json.loads(row.body)["price"]),
                report_seq=row.report_seq,
                waiting_reports=waiting[row.mission_id],
            )
        )
    return found


async def _waiting(survey: Survey, channel: str) -> Counter[str]:
    """How many reports about each mission wait for a service."""
    query = select(outbox.c.stream, func.count().label("waiting")).where(
        outbox.c.channel == channel
    )
    rows = await survey.rows(query.group_by(outbox.c.stream))
    return Counter({row.stream: row.waiting for row in rows})


async def _chains(survey: Survey) -> Mapping[str, Mapping[str, list[CustodyLink]]]:
    """By delivery and package: the chain of custody."""
    found: dict[str, dict[str, list[CustodyLink]]] = defaultdict(lambda: defaultdict(list))
    async for row in survey.each(select(custody).order_by(custody.c.seq)):
        found[row.delivery_id][row.package_id].append(_link(row))
    return found


def _link(row: Any) -> CustodyLink:  # a row of custody
    return CustodyLink(
        kind=row.custodian_kind, custodian_id=row.custodian_id, mission_id=row.mission_id
    )


async def _hints(survey: Survey) -> AsyncIterator[AnyFacts]:
    waiting = await _waiting(survey, "registry")
    columns = select(
        missions.c.mission_id, missions.c.drone_id, missions.c.state, missions.c.report_seq
    )
    async for row in survey.each(columns):
        yield HintFacts(
            mission_id=row.mission_id,
            drone_id=row.drone_id,
            state=row.state,
            is_live=row.state in LIVE_MISSION_STATES,
            report_seq=row.report_seq,
            waiting_reports=waiting[row.mission_id],
        )


async def _drones(survey: Survey) -> AsyncIterator[AnyFacts]:
    columns = select(missions.c.drone_id, missions.c.provider_id).where(is_live)
    async for row in survey.each(columns.distinct()):
        yield DroneFacts(drone_id=row.drone_id, provider_id=row.provider_id)


FACTS: Final[dict[str, FactReader]] = {
    "deliveries": _deliveries,
    "hints": _hints,
    "drones": _drones,
}
