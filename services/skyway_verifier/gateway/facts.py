"""What the gateway says of deliveries, for composition's facts to be compared with."""

from collections import defaultdict
from collections.abc import AsyncIterator, Mapping

from skyway_gateway.deliveries.lifecycle.delivery import TERMINAL_STATES
from skyway_gateway.delivery_tables import deliveries, missions, packages
from skyway_gateway.tables import api_keys, known_networks, outbox, quotes
from sqlalchemy import func, select

from skyway.contracts.station_check import NetworkStations
from skyway_verifier.facts import (
    CopyFacts,
    DeliveryFacts,
    Facts,
    MissionFacts,
    PackageFacts,
    stations_hash,
)
from skyway_verifier.gateway.packages import package_stories
from skyway_verifier.rule import Survey


async def read_facts(survey: Survey) -> Facts:
    """The facts of the gateway's database."""
    of_providers = api_keys.c.role == "provider", api_keys.c.deleted_wall_ms.is_(None)
    keys = await survey.rows(select(api_keys.c.subject_id).where(*of_providers).distinct())
    return Facts(
        deliveries=await _deliveries(survey),
        providers={row.subject_id: row.subject_id for row in keys},
        copies={each.key: each async for each in _copies(survey)},
    )


async def _deliveries(survey: Survey) -> Mapping[str, DeliveryFacts]:
    flown, carried = await _missions(survey), await _packages(survey)
    to_composition = select(outbox.c.stream, func.count()).where(outbox.c.channel == "composition")
    waiting = dict(
        [tuple(row) for row in await survey.rows(to_composition.group_by(outbox.c.stream))]
    )
    names = "delivery_id", "state", "is_queued", "cancel_reason", "is_leaving"
    return {
        row.delivery_id: DeliveryFacts(
            row.delivery_id,
            is_over=(is_over := row.state in TERMINAL_STATES),
            is_queued=row.is_queued or (row.cancel_reason is not None and not is_over),
            is_leaving=row.is_leaving,
            waiting_messages=waiting.get(row.delivery_id, 0),
            missions=tuple(flown.get(row.delivery_id, ())),
            packages=carried.get(row.delivery_id, {}),
        )
        async for row in survey.each(select(*(deliveries.c[name] for name in names)))
    }


async def _missions(survey: Survey) -> Mapping[str, list[MissionFacts]]:
    found: dict[str, list[MissionFacts]] = defaultdict(list)
    async for row in survey.each(select(missions)):
        mission = MissionFacts(
            *(row.mission_id, row.attempt, row.trip, row.provider_id, row.drone_id, row.state),
            price=(row.price_amount, row.currency),
            report_seq=row.report_seq,
        )
        found[row.delivery_id].append(mission)
    return found


async def _packages(survey: Survey) -> Mapping[str, dict[str, PackageFacts]]:
    """By delivery: its packages with their custodians."""
    found: dict[str, dict[str, PackageFacts]] = defaultdict(dict)
    for (delivery_id, package_id), story in (await survey.once(package_stories)).items():
        links = ((*link, story.row.mission_id) for link in story.links)
        found[delivery_id][package_id] = PackageFacts.of(links)
    return found


async def _copies(survey: Survey) -> AsyncIterator[CopyFacts]:
    async for row in survey.each(select(known_networks)):
        stations = NetworkStations.read(row.stations)
        places = zip(stations.station_ids, stations.positions, strict=True)
        text = stations_hash((each, *position) for each, position in places)
        yield CopyFacts(f"network {row.network_id}", max(row.version, stations.version), text)
    async for row in survey.each(select(quotes).where(quotes.c.hold_id.is_not(None))):
        yield CopyFacts(f"hold {row.hold_id}", text=row.customer_id)
    async for row in survey.each(select(packages).where(packages.c.promised_ms.is_not(None))):
        yield CopyFacts(f"promise {row.delivery_id}/{row.package_id}", row.promised_ms)
