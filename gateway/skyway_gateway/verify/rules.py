"""All rules of the gateway's database."""

import json
from typing import Final

from pydantic import TypeAdapter

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event import DeliveryEvent
from skyway.contracts.mission import OfferLimits
from skyway.delivery.request import DeliveryRequest
from skyway.geo import Position
from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.storage_rules import storage_rules
from skyway.runtime.verification.stored_forms import form_rule
from skyway_gateway.deliveries.lifecycle.delivery import FlownMission, Proof, Refusal
from skyway_gateway.quotes.quote import Offer
from skyway_gateway.tables import (
    deliveries,
    events,
    metadata,
    missions,
    outbox,
    packages,
    quotes,
    webhooks,
)
from skyway_gateway.verify.calls import CALLS
from skyway_gateway.verify.deliveries import DELIVERIES
from skyway_gateway.verify.events import EVENTS
from skyway_gateway.verify.missions import MISSIONS
from skyway_gateway.verify.notifications import NOTIFICATIONS
from skyway_gateway.verify.packages import PACKAGES

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
        quotes.c.request: DeliveryRequest.read,
        quotes.c.offers: TypeAdapter(tuple[Offer, ...]).validate_json,
        quotes.c.infeasible: _REASONS,
        outbox.c.payload: json.loads,
    }
)

#: The most important rules first: those of storage say whether the others can be believed.
RULES: Final[tuple[Rule, ...]] = (
    *storage_rules(metadata),
    _FORMS,
    *DELIVERIES,
    *PACKAGES,
    *MISSIONS,
    *EVENTS,
    *NOTIFICATIONS,
    *CALLS,
)
