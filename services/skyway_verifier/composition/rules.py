"""All rules of composition's database."""

import json
from typing import Final

from pydantic import TypeAdapter
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
    drone_links,
    instructions,
    metadata,
    mission_steps,
    missions,
    offer_holds,
    outbox,
)

from skyway.contracts.candidate import Candidate
from skyway.contracts.drone_report import Connection, DroneEvent, DroneState
from skyway.contracts.instruction import Instruction
from skyway.contracts.mission import Cancellation, Mission
from skyway.delivery.request import DeliveryRequest
from skyway_verifier.composition.calendars import CALENDARS, SHARED, read_stored_stays
from skyway_verifier.composition.custody import CUSTODY
from skyway_verifier.composition.links import LINKS, QUARANTINE
from skyway_verifier.composition.missions import MISSIONS, NO_SHOWS, REPORTS
from skyway_verifier.composition.networks import CLOSURES, NETWORKS
from skyway_verifier.composition.pads import HOLDS, PADS
from skyway_verifier.composition.steps import STEPS
from skyway_verifier.rule import Rule
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
    *PADS,
    *CLOSURES,
    *NETWORKS,
    *LINKS,
    *QUARANTINE,
    *NO_SHOWS,
    *REPORTS,
)
