"""All rules of composition's database."""

import json
from typing import Final

from pydantic import TypeAdapter

from skyway.contracts.candidate import Candidate
from skyway.contracts.drone_report import Connection, DroneEvent, DroneState
from skyway.contracts.instruction import Instruction
from skyway.contracts.mission import Cancellation, Mission
from skyway.delivery.request import DeliveryRequest
from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.storage_rules import outbox_rules, storage_rules
from skyway.runtime.verification.stored_forms import form_rule
from skyway_composition.closures.closure import Area
from skyway_composition.missions.booking.held_offer import HELD_OFFERS
from skyway_composition.missions.mission.record import Aim, Proposal, Stuck, Trouble
from skyway_composition.missions.mission.step_store import read_step
from skyway_composition.tables import (
    alarms,
    cancellations,
    closures,
    cut_steps,
    drone_links,
    instructions,
    metadata,
    mission_steps,
    missions,
    offer_holds,
    outbox,
)
from skyway_composition.verify.calendars import CALENDARS, read_stored_stays
from skyway_composition.verify.custody import CUSTODY
from skyway_composition.verify.links import LINKS
from skyway_composition.verify.missions import MISSIONS, REPORTS
from skyway_composition.verify.networks import CLOSURES, NETWORKS
from skyway_composition.verify.pads import HOLDS, PADS
from skyway_composition.verify.steps import STEPS

_FORMS: Final = form_rule(
    {
        missions.c.body: Mission.read,
        missions.c.request: DeliveryRequest.read,
        missions.c.candidate: Candidate.read,
        missions.c.stuck: Stuck.read,
        missions.c.trouble: Trouble.read,
        missions.c.proposal: Proposal.read,
        missions.c.aims: TypeAdapter(tuple[Aim, ...]).validate_json,
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
    ),
    *outbox_rules(outbox, channels=("gateway", "mqtt", "registry")),
    _FORMS,
    *MISSIONS,
    *CALENDARS,
    *HOLDS,
    *STEPS,
    *CUSTODY,
    *PADS,
    *CLOSURES,
    *NETWORKS,
    *LINKS,
    *REPORTS,
)
