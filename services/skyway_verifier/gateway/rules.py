"""All rules of the gateway's database."""

import json
from typing import Final

from pydantic import AnyHttpUrl, TypeAdapter
from skyway_gateway.access.scopes import Scope
from skyway_gateway.deliveries.lifecycle.delivery import Proof
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission, Refusal
from skyway_gateway.delivery_tables import deliveries, missions, packages
from skyway_gateway.notifications.secret_store import read_previous
from skyway_gateway.notifications.secret_vault import read_stored_secret
from skyway_gateway.quotes.store import Offer
from skyway_gateway.tables import (
    api_keys,
    events,
    idempotency,
    known_networks,
    metadata,
    outbox,
    quotes,
    replicas,
    session_links,
    sessions,
    webhooks,
)

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event import DeliveryEvent
from skyway.contracts.mission import OfferLimits
from skyway.contracts.station_check import NetworkStations
from skyway.delivery.request import DeliveryRequest
from skyway.geo import Position
from skyway_verifier.gateway.calls import API_KEYS, CALLS
from skyway_verifier.gateway.deliveries import DELIVERIES, MISSIONS, OFFERS
from skyway_verifier.gateway.events import EVENTS, NOTIFICATIONS
from skyway_verifier.gateway.packages import PACKAGES
from skyway_verifier.rule import Rule
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

_FORMS: Final = form_rule(
    {
        deliveries.c.request: DeliveryRequest.read,
        deliveries.c.pickup_position: _POSITION,
        deliveries.c.refusals: TypeAdapter(tuple[Refusal, ...]).validate_json,
        deliveries.c.reasons: _REASONS,
        deliveries.c.offer: OfferLimits.read,
        packages.c.proof: Proof.read,
        packages.c.position: _POSITION,
        missions.c.body: FlownMission.read,
        events.c.body: DeliveryEvent.read,
        webhooks.c.event_types: TypeAdapter(tuple[str, ...]).validate_json,
        webhooks.c.url: TypeAdapter(AnyHttpUrl).validate_python,
        webhooks.c.secret: read_stored_secret,
        webhooks.c.previous_secrets: read_previous,
        quotes.c.request: DeliveryRequest.read,
        quotes.c.offers: TypeAdapter(tuple[Offer, ...]).validate_json,
        quotes.c.infeasible: _REASONS,
        known_networks.c.stations: NetworkStations.read,
        outbox.c.payload: json.loads,
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
    *EVENTS,
    *NOTIFICATIONS,
    *CALLS,
    *API_KEYS,
)
