"""All rules of composition's database, and its facts for the rules across services."""

import json
from collections import defaultdict
from collections.abc import AsyncIterator, Mapping
from typing import Any, Final

from pydantic import TypeAdapter
from skyway_composition.closures.closure import Area
from skyway_composition.missions.booking.hold_store import HELD_OFFERS
from skyway_composition.missions.mission.record import PROMISED, Aim, Proposal, Stuck, Trouble
from skyway_composition.missions.mission.share import read_shares
from skyway_composition.missions.mission.step_store import read_step
from skyway_composition.tables import (
    alarms,
    cancellations,
    closures,
    custody,
    cut_steps,
    deliveries,
    drone_links,
    instructions,
    is_live,
    is_queued,
    metadata,
    mission_steps,
    missions,
    networks,
    offer_holds,
    outbox,
    stations,
)
from sqlalchemy import select

from skyway.contracts.candidate import Candidate
from skyway.contracts.drone_report import Connection, DroneEvent, DroneState
from skyway.contracts.instruction import Instruction
from skyway.contracts.mission import LIVE_MISSION_STATES, Cancellation, Mission
from skyway.delivery.request import DeliveryRequest
from skyway.units import moment_to_ms
from skyway_verifier.composition.calendars import (
    CALENDARS,
    SHARED,
    guests_of_hosts,
    owners,
    read_stored_stays,
    shares_of,
)
from skyway_verifier.composition.custody import CUSTODY, package_stories
from skyway_verifier.composition.links import LINKS, QUARANTINE
from skyway_verifier.composition.missions import MISSIONS, NO_SHOWS, REPORTS, waiting_reports
from skyway_verifier.composition.networks import CLOSURES, NETWORKS
from skyway_verifier.composition.pads import HOLDS, PADS
from skyway_verifier.composition.proofs import PROOFS
from skyway_verifier.composition.steps import STEPS
from skyway_verifier.facts import (
    CopyFacts,
    DeliveryFacts,
    Facts,
    HintFacts,
    MissionFacts,
    PackageFacts,
    stations_hash,
)
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import form_rule, outbox_rules, storage_rules

_FORMS: Final = form_rule(
    {
        missions.c.body: Mission.read,
        missions.c.request: DeliveryRequest.read,
        missions.c.candidate: Candidate.read,
        missions.c.stuck: Stuck.read,
        missions.c.trouble: Trouble.read,
        missions.c.proposal: Proposal.read,
        missions.c.aims: TypeAdapter(tuple[Aim, ...]).validate_json,
        missions.c.promised: PROMISED.validate_json,
        missions.c.shares: read_shares,
        missions.c.stays: read_stored_stays,
        mission_steps.c.step: read_step,
        mission_steps.c.event: DroneEvent.read,
        cut_steps.c.event: DroneEvent.read,
        instructions.c.body: TypeAdapter[object](Instruction).validate_json,
        drone_links.c.state: DroneState.read,
        drone_links.c.connection: Connection.read,
        cancellations.c.answer: Cancellation.read,
        closures.c.area: Area.read,
        offer_holds.c.offers: HELD_OFFERS.validate_json,
        alarms.c.data: json.loads,
        outbox.c.payload: json.loads,
    }
)

#: The most important rules first: those of storage say whether the others can be believed.
RULES: Final[tuple[Rule, ...]] = (
    *storage_rules(
        metadata,
        triggers=(
            "pad_taken_on_insert",
            "pad_taken_on_update",
            "drone_time_taken_on_insert",
            "drone_time_taken_on_update",
        ),
        # A chain begins when its drone is planned to load.
        ahead=(custody.c.at_ms,),
    ),
    *outbox_rules(outbox, channels=("gateway", "mqtt", "registry")),
    _FORMS,
    *MISSIONS,
    *CALENDARS,
    *HOLDS,
    *STEPS,
    *SHARED,
    *CUSTODY,
    *PROOFS,
    *PADS,
    *CLOSURES,
    *NETWORKS,
    *LINKS,
    *QUARANTINE,
    *NO_SHOWS,
    *REPORTS,
)


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
    waiting = await survey.once(waiting_reports)
    found: dict[str, list[MissionFacts]] = defaultdict(list)
    shares = await survey.once(shares_of)
    async for row in survey.each(select(missions)):
        host, *guests = shares.get(row.mission_id) or (None,)
        price = json.loads(row.body)["price"] if host is None else host.charged.model_dump()
        # The gateway is not notified when a mission is sent.
        state = "BOOKED" if row.state == "QUEUED" else row.state
        # The host is a row of missions, a guest has a share.
        parts: list[tuple[Any, Any]] = [(row, price)]
        for of, charged in parts + [(each, each.charged.model_dump()) for each in guests]:
            reports = waiting.get(("gateway", of.mission_id), ())
            mission = MissionFacts(
                *(of.mission_id, of.attempt, of.trip, row.provider_id, row.drone_id, state),
                price=(charged["amount"], charged["currency"]),
                report_seq=of.report_seq,
                waiting_reports=len(reports),
                tries=max((each.attempts for each in reports), default=0),
            )
            found[of.delivery_id].append(mission)
    return found


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
    waiting = await survey.once(waiting_reports)
    names = "mission_id", "drone_id", "state", "report_seq"
    rows = survey.each(select(*(missions.c[name] for name in names)))
    return {
        row.mission_id: HintFacts(
            *(row.mission_id, row.drone_id, row.state, row.state in LIVE_MISSION_STATES),
            report_seq=row.report_seq,
            waiting_reports=len(waiting.get(("registry", row.mission_id), ())),
        )
        async for row in rows
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
    # The gateway may not know yet that a promise is firm.
    waiting = await survey.once(waiting_reports)
    of_queued = select(missions).where(is_queued, missions.c.promised.is_not(None))
    async for row in survey.each(of_queued.where(missions.c.firm_ms.is_(None))):
        if ("gateway", row.mission_id) in waiting:
            continue
        for each in PROMISED.validate_json(row.promised):
            alone = row.delivery_id, each.package_id
            owner = owner_of.get((row.mission_id, each.package_id), alone)
            if owner is not None:
                yield CopyFacts(f"promise {'/'.join(owner)}", moment_to_ms(each.eta_at))
