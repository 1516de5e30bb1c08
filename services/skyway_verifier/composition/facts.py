"""What composition says of deliveries, missions and drones, for other services' facts."""

import json
from collections import defaultdict
from collections.abc import AsyncIterator, Mapping
from typing import Any, NamedTuple

from skyway_composition.missions.mission.row import PROMISED
from skyway_composition.tables import (
    deliveries,
    drone_links,
    is_live,
    is_queued,
    missions,
    networks,
    offer_holds,
    outbox,
    stations,
)
from sqlalchemy import func, select

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.units import moment_to_ms
from skyway_verifier.composition.custody import package_stories
from skyway_verifier.composition.shares import guests_of_hosts, owners, shares_of
from skyway_verifier.facts import (
    CopyFacts,
    DeliveryFacts,
    Facts,
    HintFacts,
    MissionFacts,
    PackageFacts,
    stations_hash,
)
from skyway_verifier.rule import Survey


class _Waiting(NamedTuple):
    """How many reports about a mission wait, and how often the first was sent in vain."""

    reports: int = 0
    tries: int = 0


async def read_facts(survey: Survey) -> Facts:
    """The facts of composition's database."""
    live = select(missions.c.drone_id, missions.c.provider_id).where(is_live).distinct()
    flown, carried = await _missions(survey), await _packages(survey)
    return Facts(
        deliveries={
            row.delivery_id: DeliveryFacts(
                row.delivery_id,
                is_over=row.closed_ms is not None,
                missions=tuple(flown.get(row.delivery_id, ())),
                packages=carried.get(row.delivery_id, {}),
            )
            async for row in survey.each(select(deliveries))
        },
        hints=await _hints(survey),
        drones={(row[0], row[1]): row.drone_id for row in await survey.rows(live)},
        copies={each.key: each async for each in _copies(survey)},
    )


async def _missions(survey: Survey) -> Mapping[str, list[MissionFacts]]:
    """By delivery: its missions; a shared mission is one of each of its deliveries."""
    waiting = await _waiting(survey, "gateway")
    found: dict[str, list[MissionFacts]] = defaultdict(list)
    shares = await survey.once(shares_of)
    async for row in survey.each(select(missions)):
        host, *guests = shares.get(row.mission_id) or (None,)
        price = json.loads(row.body)["price"] if host is None else host.charged.model_dump()
        # The host is a row of missions, a guest has a share.
        parts: list[tuple[Any, Any]] = [(row, price)]
        for of, charged in parts + [(each, each.charged.model_dump()) for each in guests]:
            mission = MissionFacts(
                mission_id=of.mission_id,
                attempt=of.attempt,
                trip=of.trip,
                provider_id=row.provider_id,
                drone_id=row.drone_id,
                # The gateway is not notified when a mission is sent.
                state="BOOKED" if row.state == "QUEUED" else row.state,
                price=(charged["amount"], charged["currency"]),
                report_seq=of.report_seq,
                waiting_reports=waiting[of.mission_id].reports,
                tries=waiting[of.mission_id].tries,
            )
            found[of.delivery_id].append(mission)
    return found


async def _waiting(survey: Survey, channel: str) -> Mapping[str, _Waiting]:
    """The reports about each mission that wait for a service."""
    query = select(outbox.c.stream, func.count(), func.max(outbox.c.attempts))
    of_channel = query.where(outbox.c.channel == channel).group_by(outbox.c.stream)
    rows = await survey.rows(of_channel)
    return defaultdict(_Waiting, {row[0]: _Waiting(*row[1:]) for row in rows})


async def _packages(survey: Survey) -> Mapping[str, dict[str, PackageFacts]]:
    """By delivery: its packages with their custodians."""
    # The gateway knows the mission of a guest by its own id.
    guest_id = {
        (host_id, row.delivery_id): row.mission_id
        for host_id, rows in (await survey.once(guests_of_hosts)).items()
        for row in rows
    }
    found: dict[str, dict[str, PackageFacts]] = defaultdict(dict)
    for (delivery_id, package_id), story in (await survey.once(package_stories)).items():
        links = (
            (row.custodian_kind, row.custodian_id, guest_id.get((by, delivery_id), by))
            for row, by in ((row, row.mission_id) for row in story.chain)
        )
        found[delivery_id][package_id] = PackageFacts.of(links)
    return found


async def _hints(survey: Survey) -> Mapping[str, HintFacts]:
    waiting = await _waiting(survey, "registry")
    columns = select(
        missions.c.mission_id, missions.c.drone_id, missions.c.state, missions.c.report_seq
    )
    return {
        row.mission_id: HintFacts(
            mission_id=row.mission_id,
            drone_id=row.drone_id,
            state=row.state,
            is_live=row.state in LIVE_MISSION_STATES,
            report_seq=row.report_seq,
            waiting_reports=waiting[row.mission_id].reports,
        )
        async for row in survey.each(columns)
    }


async def _copies(survey: Survey) -> AsyncIterator[CopyFacts]:
    places: dict[str, list[tuple[str, float, float]]] = defaultdict(list)
    async for row in survey.each(select(stations)):
        places[row.network_id].append((row.station_id, row.longitude_deg, row.latitude_deg))
    async for row in survey.each(select(networks)):
        text = stations_hash(places[row.network_id])
        yield CopyFacts(f"network {row.network_id}", row.version, text)
    async for row in survey.each(select(offer_holds)):
        yield CopyFacts(f"hold {row.hold_id}", text=row.customer_id)
    async for row in survey.each(select(drone_links).where(drone_links.c.renewed_ms.is_not(None))):
        yield CopyFacts(f"renewal {row.drone_id}", row.renewed_ms)
    owner_of = await survey.once(owners)
    of_queued = select(missions).where(is_queued, missions.c.promised.is_not(None))
    async for row in survey.each(of_queued):
        for each in PROMISED.validate_json(row.promised):
            alone = row.delivery_id, each.package_id
            owner = owner_of.get((row.mission_id, each.package_id), alone)
            if owner is not None:
                yield CopyFacts(f"promise {'/'.join(owner)}", moment_to_ms(each.eta_at))
