"""The rules of links to drones, of the replicas that share them, and of messages set aside.

Gapless instructions, open ones in the outbox, true counters; messages are shown as they arrived.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

from skyway_composition.quarantine.quarantined import MOST_PAYLOAD_BYTES
from skyway_composition.quarantine.store import quarantined
from skyway_composition.tables import (
    cut_steps,
    drone_links,
    instructions,
    mission_steps,
    missions,
    outbox,
    quarantine,
    replicas,
)
from sqlalchemy import exists, func, select

from skyway.bounds import LATEST
from skyway.contracts.topics import INSTRUCTIONS
from skyway.units import moment_to_ms
from skyway_verifier.finders import any_of, readable, repeats, rows_where
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import replica_rule

#: A drone sends its state after each event. When its link breaks between the two, the events that
#: it sent last are not in its last state.
_MOST_EVENTS_BEFORE_STATE: Final = 10

_LATEST_MS: Final = moment_to_ms(LATEST)

_sent = instructions.alias("sent")
_before = instructions.alias("before")
_is_open = instructions.c.status.in_(("SENT", "RECEIVED"))
_in_outbox = exists().where(
    outbox.c.channel == "mqtt",
    outbox.c.message_id == instructions.c.instruction_id,
    outbox.c.stream == instructions.c.drone_id,
    outbox.c.confirmed_by == "receiver",
)
_is_of_drone = instructions.c.drone_id == drone_links.c.drone_id
_last_seq = (
    select(func.coalesce(func.max(instructions.c.seq), 0))
    .where(_is_of_drone, instructions.c.stream == drone_links.c.stream)
    .correlate(drone_links)
    .scalar_subquery()
)
_last_stream = (
    select(func.coalesce(func.max(instructions.c.stream), 0))
    .where(_is_of_drone)
    .correlate(drone_links)
    .scalar_subquery()
)

_COUNTERS: Final = (
    "With wrong counters the drone refuses instructions as gaps, or its events are dropped. Set "
    "`stream` and `last_seq` to those of the drone's last row in `instructions`, and "
    "`last_event_seq` to the `last_event_seq` of the drone's last state whose events were handled."
)


def _differs(row: Any) -> bool:  # a row of instructions
    # The mission of an answered instruction may be deleted.
    of_mission = () if row.mission_id is None else ("mission_id", "mission_revision")
    names = "instruction_id", "stream", "seq", "kind", *of_mission
    return not repeats(row, json.loads(row.body), *names)


_REPEATED: Final = (
    select(instructions, drone_links.c.provider_id, outbox.c.payload, outbox.c.address)
    .join(outbox, outbox.c.message_id == instructions.c.instruction_id)
    .join(drone_links, drone_links.c.drone_id == instructions.c.drone_id)
)


def _is_changed(row: Any) -> bool:  # a row of _REPEATED
    """Whether the outbox repeats an instruction with another text, or to another drone."""
    is_here = row.address == INSTRUCTIONS(row.provider_id, row.drone_id).name
    return not (is_here and readable(False, _is_same, row.body, row.payload))


def _is_same(body: str, payload: bytes) -> bool:
    """Whether a message is the stored instruction; the message also has a trace context."""
    stored, sent = json.loads(body), json.loads(payload)
    return bool(stored | {"traceparent": None} == sent | {"traceparent": None})


def _is_wrongly_occupied(row: Any) -> bool:  # a row of drone_links
    """Whether the state reports a mission or a landing in the open, and the link does not."""
    if row.state is None:
        return bool(row.is_occupied)
    state = json.loads(row.state)
    is_occupied = state["mission_id"] is not None or state["activity"] == "DOWN"
    return bool(is_occupied != row.is_occupied)


async def _wrongly_counted(survey: Survey) -> list[str]:
    """Drones whose link does not count a stored event, or counts events that nobody has sent."""
    links = {row.drone_id: row async for row in survey.each(select(drone_links))}
    stored = await _stored_events(survey, {drone: row.stream for drone, row in links.items()})
    found = []
    for drone_id, row in links.items():
        in_state = 0 if row.state is None else readable(None, _events_in_state, row)
        most = None if in_state is None else max(in_state, stored[drone_id])
        is_more = most is not None and row.last_event_seq > most + _MOST_EVENTS_BEFORE_STATE
        if is_more or row.last_event_seq < stored[drone_id]:
            found.append(drone_id)
    return found


def _events_in_state(row: Any) -> int | None:  # a row of drone_links
    """How many events a drone has sent by its last state; None if it follows another stream."""
    value = json.loads(row.state)
    return int(value["last_event_seq"]) if value["stream"] == row.stream else None


async def _stored_events(survey: Survey, streams: Mapping[str, int]) -> Counter[str]:
    """By drone: the highest number of an event of this stream that is stored or was confirmed."""
    found: Counter[str] = Counter()
    events = select(missions.c.drone_id, mission_steps.c.event).join(
        missions, missions.c.mission_id == mission_steps.c.mission_id
    )
    cuts = select(missions.c.drone_id, cut_steps.c.event).join(
        missions, missions.c.mission_id == cut_steps.c.mission_id
    )
    for query in (events.where(mission_steps.c.event.is_not(None)), cuts):
        async for row in survey.each(query):
            seq = readable(0, _number_in, row.event, streams.get(row.drone_id, 0))
            found[row.drone_id] = max(found[row.drone_id], seq)
    async for row in survey.each(select(instructions)):
        if row.stream == streams.get(row.drone_id):
            seq = readable(0, _confirmed, row.body)
            found[row.drone_id] = max(found[row.drone_id], seq)
    return found


def _number_in(event: str, stream: int) -> int:
    value = json.loads(event)
    return int(value["seq"]) if value["stream"] == stream else 0


def _confirmed(instruction: str) -> int:
    return int(json.loads(instruction)["events_confirmed_seq"])


LINKS: Final = (
    Rule(
        "a link was renewed at a possible moment",
        select(drone_links.c.drone_id).where(~drone_links.c.renewed_ms.between(0, _LATEST_MS)),
        "Set `renewed_ms` to NULL: only what the broker has kept from before is judged by it.",
    ),
    Rule(
        # Answered instructions of deliveries that ended long ago are deleted.
        "I7 an unanswered instruction follows the one before it",
        select(_sent.c.instruction_id).where(
            _sent.c.seq > 1,
            _sent.c.status.in_(("SENT", "RECEIVED")),
            ~exists().where(
                _before.c.drone_id == _sent.c.drone_id,
                _before.c.stream == _sent.c.stream,
                _before.c.seq == _sent.c.seq - 1,
            ),
        ),
        "A drone refuses an instruction after a gap. Restore the missing row from a backup, or "
        "open a new stream: raise `drone_links.stream` by 1 and set `last_seq` to 0.",
    ),
    Rule(
        "I7 an unanswered instruction is in the outbox",
        select(instructions.c.instruction_id).where(_is_open, ~_in_outbox),
        "The drone will never get it. If the drone's state shows that it has the instruction, wait "
        "for its answer; else cancel or replan the mission, which sends a new instruction.",
    ),
    Rule(
        "I7 an answered instruction is not repeated",
        select(instructions.c.instruction_id).where(~_is_open, _in_outbox),
        "Delete its row of `outbox`; the drone has answered it.",
    ),
    Rule(
        "I7 the outbox repeats an instruction as it was stored",
        rows_where(_REPEATED, _is_changed, "instruction_id"),
        "Set the `payload` of the row of `outbox` to `instructions.body`, and its `address` to the "
        "topic of the drone.",
    ),
    Rule(
        "an instruction's columns say what its body says",
        rows_where(select(instructions), _differs, "instruction_id"),
        "The drone has what the body says. Set the columns to its values.",
    ),
    Rule(
        "I7 a link counts the drone's instructions",
        any_of(
            drone_links.c.drone_id,
            drone_links.c.last_seq != _last_seq,
            drone_links.c.stream < _last_stream,
            drone_links.c.acked_stream > drone_links.c.stream,
        ),
        _COUNTERS,
    ),
    Rule(
        "I7 a link counts the drone's events",
        _wrongly_counted,
        _COUNTERS,
    ),
    Rule(
        "I7 an instruction has a link to its drone",
        select(instructions.c.instruction_id).where(~exists().where(_is_of_drone)),
        "Restore the row of `drone_links` from a backup; its counters are those of the drone's "
        "last row in `instructions`.",
    ),
    Rule(
        "I2 a link says whether its drone is occupied",
        rows_where(select(drone_links), _is_wrongly_occupied, "drone_id"),
        "Set `is_occupied` to whether `state` names a mission or the activity DOWN. While it is "
        "wrong, a drone that flies can be booked, or a free drone cannot.",
    ),
    Rule(
        "a link belongs to the provider of its drone's missions",
        select(drone_links.c.drone_id).where(
            exists().where(
                missions.c.drone_id == drone_links.c.drone_id,
                missions.c.provider_id != drone_links.c.provider_id,
            )
        ),
        "The registry knows the drone's provider. Correct the column that differs.",
    ),
    replica_rule(replicas),
)


def _is_damaged(row: Any) -> bool:  # a row of quarantine
    shown = quarantined(row)
    is_hash = hashlib.sha256(row.payload).hexdigest() == row.payload_sha256
    return (
        len(row.payload) != min(row.size_bytes, MOST_PAYLOAD_BYTES)
        or not (is_hash or not shown.is_whole)
        or f"/{row.provider_id}/{row.drone_id}/" not in row.topic
        or row.times < 1
        or row.first_ms > row.last_ms
    )


QUARANTINE: Final = (
    Rule(
        "a set-aside message is shown as it arrived",
        rows_where(
            select(quarantine), lambda row: readable(True, _is_damaged, row), "quarantine_id"
        ),
        "The message was never taken, so nothing depends on its row. Delete it: DELETE "
        "/v1/quarantine/{quarantine_id}.",
    ),
)
