"""What the gateway says of deliveries, for composition's facts to be compared with."""

from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Mapping
from typing import Final

from sqlalchemy import func, select

from skyway.contracts.service_facts import (
    AnyFacts,
    CopyFacts,
    CustodyLink,
    DeliveryFacts,
    MissionFacts,
    PackageFacts,
    ProviderFacts,
    stations_hash,
)
from skyway.contracts.station_check import NetworkStations
from skyway.delivery.offer import Price
from skyway.runtime.verification.fact_files import FactReader
from skyway.runtime.verification.rule import Survey
from skyway_gateway.deliveries.lifecycle.delivery import TERMINAL_STATES
from skyway_gateway.delivery_tables import custody, deliveries, missions, packages
from skyway_gateway.tables import api_keys, known_networks, outbox, quotes


async def _deliveries(survey: Survey) -> AsyncIterator[AnyFacts]:
    flown, carried = await _missions(survey), await _packages(survey)
    waiting = await _waiting(survey)
    columns = (
        deliveries.c.delivery_id,
        deliveries.c.state,
        deliveries.c.is_queued,
        deliveries.c.cancel_reason,
        deliveries.c.is_leaving,
    )
    async for row in survey.each(select(*columns)):
        is_over = row.state in TERMINAL_STATES
        yield DeliveryFacts(
            delivery_id=row.delivery_id,
            is_over=is_over,
            is_leaving=row.is_leaving,
            is_queued=row.is_queued or (row.cancel_reason is not None and not is_over),
            waiting_messages=waiting[row.delivery_id],
            missions=tuple(flown.get(row.delivery_id, ())),
            packages=tuple(carried.get(row.delivery_id, ())),
        )


async def _missions(survey: Survey) -> Mapping[str, list[MissionFacts]]:
    found: dict[str, list[MissionFacts]] = defaultdict(list)
    async for row in survey.each(select(missions)):
        found[row.delivery_id].append(
            MissionFacts(
                mission_id=row.mission_id,
                attempt=row.attempt,
                trip=row.trip,
                provider_id=row.provider_id,
                drone_id=row.drone_id,
                state=row.state,
                price=Price(amount=row.price_amount, currency=row.currency),
                report_seq=row.report_seq,
            )
        )
    return found


async def _packages(survey: Survey) -> Mapping[str, list[PackageFacts]]:
    """By delivery: its packages. Only the link to a recipient has a mission."""
    carriers = {
        (row.delivery_id, row.package_id): row.mission_id
        async for row in survey.each(select(packages))
    }
    chains: dict[tuple[str, str], list[CustodyLink]] = defaultdict(list)
    async for row in survey.each(select(custody).order_by(custody.c.seq)):
        key, kind = (row.delivery_id, row.package_id), row.custodian_kind
        by = carriers.get(key) if kind == "RECIPIENT" else None
        link = CustodyLink(kind=kind, custodian_id=row.custodian_id, mission_id=by)
        chains[key].append(link)
    found: dict[str, list[PackageFacts]] = defaultdict(list)
    for (delivery_id, package_id), chain in chains.items():
        found[delivery_id].append(PackageFacts(package_id=package_id, chain=tuple(chain)))
    return found


async def _waiting(survey: Survey) -> Counter[str]:
    """How many messages about each delivery wait for composition."""
    query = select(outbox.c.stream, func.count().label("waiting")).where(
        outbox.c.channel == "composition"
    )
    rows = await survey.rows(query.group_by(outbox.c.stream))
    return Counter({row.stream: row.waiting for row in rows})


async def _providers(survey: Survey) -> AsyncIterator[AnyFacts]:
    of_providers = api_keys.c.role == "provider", api_keys.c.deleted_wall_ms.is_(None)
    async for row in survey.each(select(api_keys.c.subject_id).where(*of_providers).distinct()):
        yield ProviderFacts(provider_id=row.subject_id)


async def _copies(survey: Survey) -> AsyncIterator[AnyFacts]:
    async for row in survey.each(select(known_networks)):
        stations = NetworkStations.read(row.stations)
        places = zip(stations.station_ids, stations.positions, strict=True)
        yield CopyFacts(
            key=f"network {row.network_id}",
            number=max(row.version, stations.version),
            text=stations_hash((each, *position) for each, position in places),
        )
    async for row in survey.each(select(quotes).where(quotes.c.hold_id.is_not(None))):
        yield CopyFacts(key=f"hold {row.hold_id}", text=row.customer_id)
    async for row in survey.each(select(packages).where(packages.c.promised_ms.is_not(None))):
        key = f"promise {row.delivery_id}/{row.package_id}"
        yield CopyFacts(key=key, number=row.promised_ms)


FACTS: Final[dict[str, FactReader]] = {
    "deliveries": _deliveries,
    "providers": _providers,
    "copies": _copies,
}
