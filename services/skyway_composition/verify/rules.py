"""All rules of composition's database, and the facts that other services compare.

The facts are what composition says of deliveries, missions and drones.
"""

import json
from collections import defaultdict
from collections.abc import AsyncIterator, Mapping
from typing import Any, Final, NamedTuple

from pydantic import TypeAdapter
from sqlalchemy import func, select

from skyway.contracts.candidate import Candidate
from skyway.contracts.drone_report import Connection, DroneEvent, DroneState
from skyway.contracts.instruction import Instruction
from skyway.contracts.mission import LIVE_MISSION_STATES, Cancellation, Mission
from skyway.contracts.service_facts import (
    AnyFacts,
    CopyFacts,
    CustodyLink,
    DeliveryFacts,
    DroneFacts,
    HintFacts,
    MissionFacts,
    PackageFacts,
    stations_hash,
)
from skyway.delivery.offer import Price
from skyway.delivery.request import DeliveryRequest
from skyway.runtime.verification.fact_files import FactReader
from skyway.runtime.verification.rule import Rule, Survey
from skyway.runtime.verification.storage_rules import outbox_rules, storage_rules
from skyway.runtime.verification.stored_forms import form_rule
from skyway.units import moment_to_ms
from skyway_composition.closures.closure import Area
from skyway_composition.missions.booking.hold_store import HELD_OFFERS
from skyway_composition.missions.mission.record import Aim, Proposal, Stuck, Trouble
from skyway_composition.missions.mission.row import PROMISED
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
from skyway_composition.verify.calendars import CALENDARS, read_stored_stays
from skyway_composition.verify.custody import CUSTODY
from skyway_composition.verify.links import LINKS
from skyway_composition.verify.missions import MISSIONS, NO_SHOWS, REPORTS
from skyway_composition.verify.networks import CLOSURES, NETWORKS
from skyway_composition.verify.pads import HOLDS, PADS
from skyway_composition.verify.quarantine import QUARANTINE
from skyway_composition.verify.reach import REACH
from skyway_composition.verify.shares import SHARED, guests_of_hosts, owners, shares_of
from skyway_composition.verify.steps import STEPS
from skyway_composition.verify.windows import WINDOWS

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
    *WINDOWS,
    *SHARED,
    *CUSTODY,
    *REACH,
    *PADS,
    *CLOSURES,
    *NETWORKS,
    *LINKS,
    *QUARANTINE,
    *NO_SHOWS,
    *REPORTS,
)


class _Waiting(NamedTuple):
    """How many reports about a mission wait, and how often the first was sent in vain."""

    reports: int = 0
    tries: int = 0


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
    shares = await survey.once(shares_of)
    async for row in survey.each(select(missions)):
        host, *of_guests = shares.get(row.mission_id) or (None,)
        price = Price.model_validate(json.loads(row.body)["price"])
        price = price if host is None else host.charged
        found[row.delivery_id].append(
            _facts(row, row, price=price, report_seq=row.report_seq, waiting=waiting)
        )
        for each in of_guests:
            found[each.delivery_id].append(
                _facts(row, each, price=each.charged, report_seq=each.report_seq, waiting=waiting)
            )
    return found


def _facts(
    row: Any,  # a row of missions
    of: Any,  # the same row, or the share of a guest
    *,
    price: Price,
    report_seq: int,
    waiting: Mapping[str, _Waiting],
) -> MissionFacts:
    """The facts of a mission, as one of its deliveries sees it."""
    return MissionFacts(
        mission_id=of.mission_id,
        attempt=of.attempt,
        trip=of.trip,
        provider_id=row.provider_id,
        drone_id=row.drone_id,
        # The gateway is not notified when a mission is sent.
        state="BOOKED" if row.state == "QUEUED" else row.state,
        price=price,
        report_seq=report_seq,
        waiting_reports=waiting[of.mission_id].reports,
        tries=waiting[of.mission_id].tries,
    )


async def _waiting(survey: Survey, channel: str) -> Mapping[str, _Waiting]:
    """The reports about each mission that wait for a service."""
    query = select(
        outbox.c.stream, func.count().label("reports"), func.max(outbox.c.attempts).label("tries")
    ).where(outbox.c.channel == channel)
    rows = await survey.rows(query.group_by(outbox.c.stream))
    return defaultdict(_Waiting, {row[0]: _Waiting(*row[1:]) for row in rows})


async def _chains(survey: Survey) -> Mapping[str, Mapping[str, list[CustodyLink]]]:
    """By delivery and package: the chain of custody."""
    found: dict[str, dict[str, list[CustodyLink]]] = defaultdict(lambda: defaultdict(list))
    # The gateway knows the mission of a guest by its own id.
    guest_id = {
        (host_id, row.delivery_id): row.mission_id
        for host_id, rows in (await survey.once(guests_of_hosts)).items()
        for row in rows
    }
    async for row in survey.each(select(custody).order_by(custody.c.seq)):
        mission_id = guest_id.get((row.mission_id, row.delivery_id), row.mission_id)
        found[row.delivery_id][row.package_id].append(
            CustodyLink(
                kind=row.custodian_kind, custodian_id=row.custodian_id, mission_id=mission_id
            )
        )
    return found


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
            waiting_reports=waiting[row.mission_id].reports,
        )


async def _drones(survey: Survey) -> AsyncIterator[AnyFacts]:
    columns = select(missions.c.drone_id, missions.c.provider_id).where(is_live)
    async for row in survey.each(columns.distinct()):
        yield DroneFacts(drone_id=row.drone_id, provider_id=row.provider_id)


async def _copies(survey: Survey) -> AsyncIterator[AnyFacts]:
    places: dict[str, list[tuple[str, float, float]]] = defaultdict(list)
    async for row in survey.each(select(stations)):
        places[row.network_id].append((row.station_id, row.longitude_deg, row.latitude_deg))
    async for row in survey.each(select(networks)):
        text = stations_hash(places[row.network_id])
        yield CopyFacts(key=f"network {row.network_id}", number=row.version, text=text)
    async for row in survey.each(select(offer_holds)):
        yield CopyFacts(key=f"hold {row.hold_id}", text=row.customer_id)
    async for row in survey.each(select(drone_links).where(drone_links.c.renewed_ms.is_not(None))):
        yield CopyFacts(key=f"renewal {row.drone_id}", number=row.renewed_ms)
    owner_of = await survey.once(owners)
    of_queued = select(missions).where(is_queued, missions.c.promised.is_not(None))
    async for row in survey.each(of_queued):
        for each in PROMISED.validate_json(row.promised):
            alone = row.delivery_id, each.package_id
            owner = owner_of.get((row.mission_id, each.package_id), alone)
            if owner is not None:
                key = f"promise {'/'.join(owner)}"
                yield CopyFacts(key=key, number=moment_to_ms(each.eta_at))


FACTS: Final[dict[str, FactReader]] = {
    "deliveries": _deliveries,
    "hints": _hints,
    "drones": _drones,
    "copies": _copies,
}
