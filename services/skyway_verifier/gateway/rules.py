"""All rules of the gateway's database, and its facts for the rules across services."""

import json
from collections import defaultdict
from collections.abc import AsyncIterator, Mapping
from typing import Final

from pydantic import AnyHttpUrl, TypeAdapter
from skyway_gateway.access.scopes import Scope
from skyway_gateway.deliveries.lifecycle.delivery import TERMINAL_STATES, Proof, ProofWait
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission, Refusal
from skyway_gateway.delivery_tables import deliveries, missions, packages, proofs
from skyway_gateway.notifications.secret_store import read_previous
from skyway_gateway.notifications.secret_vault import read_stored_secret
from skyway_gateway.personal_data.details import PersonalData
from skyway_gateway.places.served import ServedPlace
from skyway_gateway.proofs.signature import Signature
from skyway_gateway.quotes.store import Offer
from skyway_gateway.sandbox.store import REPORTS
from skyway_gateway.tables import (
    api_keys,
    brandings,
    events,
    idempotency,
    known_networks,
    metadata,
    outbox,
    personal_data,
    quotes,
    replicas,
    sandbox_missions,
    session_links,
    sessions,
    webhooks,
)
from skyway_gateway.tracking.branding import Colour, ShopName
from sqlalchemy import func, select

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event import DeliveryEvent
from skyway.contracts.mission import Mission, OfferLimits
from skyway.contracts.statement_event import StatementClosed
from skyway.contracts.station_check import NetworkStations
from skyway.delivery.lateness import Conditions
from skyway.delivery.request import DeliveryRequest
from skyway.geo import Position
from skyway.ids import is_live_id
from skyway_verifier.facts import (
    CopyFacts,
    DeliveryFacts,
    Facts,
    MissionFacts,
    PackageFacts,
    stations_hash,
)
from skyway_verifier.gateway.calls import API_KEYS, CALLS
from skyway_verifier.gateway.deliveries import DELIVERIES, MISSIONS, OFFERS
from skyway_verifier.gateway.events import EVENTS, NOTIFICATIONS
from skyway_verifier.gateway.ledger import LEDGER
from skyway_verifier.gateway.packages import PACKAGES, package_stories
from skyway_verifier.gateway.personal_data import PERSONAL_DATA
from skyway_verifier.gateway.proofs import PROOFS
from skyway_verifier.gateway.sandbox import SANDBOX
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import (
    form_rule,
    outbox_rules,
    read_fernet_token,
    read_sha256,
    replica_rule,
    storage_rules,
)

_POSITION: Final = TypeAdapter(Position).validate_json
_REASONS: Final = TypeAdapter(tuple[ProviderReason, ...]).validate_json

#: A delivery's event has another type than an event about a month.
_EVENT: Final = TypeAdapter(DeliveryEvent | StatementClosed).validate_json

_FORMS: Final = form_rule(
    {
        deliveries.c.request: DeliveryRequest.read,
        deliveries.c.pickup_position: _POSITION,
        deliveries.c.refusals: TypeAdapter(tuple[Refusal, ...]).validate_json,
        deliveries.c.reasons: _REASONS,
        deliveries.c.offer: OfferLimits.read,
        packages.c.proof: Proof.read,
        packages.c.proof_wait: ProofWait.read,
        proofs.c.signature: Signature.read,
        packages.c.position: _POSITION,
        missions.c.body: FlownMission.read,
        missions.c.promised_on: Conditions.read,
        events.c.body: _EVENT,
        webhooks.c.event_types: TypeAdapter(tuple[str, ...]).validate_json,
        webhooks.c.url: TypeAdapter(AnyHttpUrl).validate_python,
        webhooks.c.secret: read_stored_secret,
        webhooks.c.previous_secrets: read_previous,
        quotes.c.request: DeliveryRequest.read,
        quotes.c.places: TypeAdapter(tuple[ServedPlace, ...]).validate_json,
        quotes.c.offers: TypeAdapter(tuple[Offer, ...]).validate_json,
        quotes.c.infeasible: _REASONS,
        known_networks.c.stations: NetworkStations.read,
        outbox.c.payload: json.loads,
        personal_data.c.details: PersonalData.read,
        sandbox_missions.c.mission: Mission.read,
        sandbox_missions.c.reports: REPORTS.validate_json,
        brandings.c.name: TypeAdapter(ShopName).validate_python,
        brandings.c.colour: TypeAdapter(Colour).validate_python,
        api_keys.c.key_hash: read_sha256,
        api_keys.c.scopes: TypeAdapter(tuple[Scope, ...]).validate_json,
        sessions.c.session_hash: read_sha256,
        session_links.c.code_hash: read_sha256,
        idempotency.c.key_hash: read_sha256,
        idempotency.c.answer: read_fernet_token,
    }
)

#: The most important rules first: those of storage say whether the others can be believed.
RULES: Final[tuple[Rule, ...]] = (
    *storage_rules(metadata),
    *outbox_rules(outbox, channels=("composition", "mqtt")),
    replica_rule(replicas),
    _FORMS,
    *DELIVERIES,
    *OFFERS,
    *PACKAGES,
    *MISSIONS,
    *LEDGER,
    *EVENTS,
    *NOTIFICATIONS,
    *CALLS,
    *API_KEYS,
    *PERSONAL_DATA,
    *PROOFS,
    *SANDBOX,
)


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
        if is_live_id(row.delivery_id)  # composition never knows test deliveries
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
