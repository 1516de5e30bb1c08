"""The rules of missions: their columns, their states, their drones, and the reports about them."""

import json
from collections import defaultdict
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from skyway_composition.tables import (
    alarms,
    deliveries,
    drone_links,
    first_planned_end_ms,
    instructions,
    is_live,
    is_open,
    is_under_way,
    mission_steps,
    missions,
    no_shows,
    outbox,
)
from sqlalchemy import and_, exists, func, or_, select

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.contracts.mission_reports import MissionReport
from skyway_verifier.composition.calendars import shares_of
from skyway_verifier.finders import any_of, differs, ms_of, readable, repeats, rows_where
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import later_than

_AGAINST_BODY: Final = (
    "Compare the row with the drone's instruction (`instructions.body`) and with the gateway's copy"
    " (`GET /v1/deliveries/{id}/plan`), and correct the value that differs."
)
#: The columns that `missions.body` repeats.
_REPEATED: Final = (
    *("mission_id", "delivery_id", "attempt", "trip", "provider_id", "drone_id"),
    *("state", "loading"),
)
#: Missions that need a plan are looked at every 2 s; clocks of machines may differ. Wall ms.
_LONGEST_WAIT_MS: Final = 600_000

_is_open = instructions.c.status.in_(("SENT", "RECEIVED"))
_is_of_mission = instructions.c.mission_id == missions.c.mission_id

_RESTORE: Final = (
    "A row of `outbox` was deleted or changed. The gateway waits for the report with the next "
    "`seq`: restore the row from a backup, or cancel the mission and settle its delivery by hand."
)

#: The services that get reports.
_RECEIVERS: Final = ("gateway", "registry")


def _differs(row: Any) -> bool:  # a row of missions
    body, request, candidate = map(json.loads, (row.body, row.request, row.candidate))
    moments = {
        "start_ms": ms_of(body["start_at"]),
        "released_ms": ms_of(body["released_at"]),
        "firm_ms": ms_of(body["firm_at"]) if "firm_at" in body else None,
    }
    flown, asked = ({each["package_id"] for each in of["packages"]} for of in (body, request))
    return (
        not repeats(row, body, *_REPEATED)
        or not repeats(row, candidate, "drone_id", "provider_id")
        or differs(row, moments)
        or row.pooling_at not in (None, request["pickup"]["station_id"])
        or not flown <= asked
    )


async def _other_expiries(survey: Survey) -> list[str]:
    """Missions that expire when none of their instructions does."""
    query = (
        select(missions.c.mission_id, missions.c.expires_ms, instructions.c.body)
        .join(instructions, instructions.c.mission_id == missions.c.mission_id)
        .where(instructions.c.kind == "MISSION")
    )
    sent: dict[tuple[str, int], set[int]] = defaultdict(set)
    for row in await survey.rows(query):
        sent[row.mission_id, row.expires_ms].add(ms_of(json.loads(row.body)["expires_at"]))
    return [mission_id for (mission_id, at_ms), ends in sent.items() if at_ms not in ends]


_WITHOUT_ALARM: Final = select(missions).where(
    is_live,
    ~exists().where(
        alarms.c.mission_id == missions.c.mission_id, alarms.c.code == "MISSION_IN_DOUBT"
    ),
)


async def _lost_proposals(survey: Survey) -> list[str]:
    columns = select(missions.c.mission_id, missions.c.proposal)
    proposing = await survey.rows(columns.where(missions.c.proposal.is_not(None)))
    unanswered = await survey.rows(select(instructions.c.instruction_id).where(_is_open))
    waiting = {row.instruction_id for row in unanswered}
    return [
        row.mission_id
        for row in proposing
        if json.loads(row.proposal)["instruction_id"] not in waiting
    ]


MISSIONS: Final = (
    Rule(
        "an alarm is acknowledged by somebody, after it was raised",
        any_of(
            alarms.c.alarm_id,
            alarms.c.acknowledged_ms.is_(None) != alarms.c.acknowledged_by.is_(None),
            alarms.c.acknowledged_ms < alarms.c.at_ms,
            and_(alarms.c.note.is_not(None), alarms.c.acknowledged_ms.is_(None)),
        ),
        "Set `acknowledged_ms` and `acknowledged_by` to NULL: an operator looks at it again.",
    ),
    Rule(
        "a mission's first instruction expires when the mission says",
        _other_expiries,
        "Set `expires_ms` to `expires_at` of the mission's first instruction.",
    ),
    Rule(
        "I2 a drone is on at most one mission",
        select(missions.c.drone_id)
        .where(is_live)
        .group_by(missions.c.drone_id)
        .having(func.count() > 1),
        "Ask the provider which mission the drone flies. Cancel the other one: POST "
        "/v1/missions/{id}/commands with CANCEL. Make the index `mission_drone` again.",
    ),
    Rule(
        "I4 a mission was sent to its drone",
        select(missions.c.mission_id).where(
            # A mission that waited in its drone's calendar to its end was never sent.
            missions.c.planned_version.is_(None),
            missions.c.mission_id.not_in(
                select(instructions.c.mission_id).where(
                    instructions.c.kind == "MISSION", instructions.c.mission_id.is_not(None)
                )
            ),
        ),
        "The drone does not know this mission, unless its instruction was deleted. If the drone's "
        "state names the mission, restore the instruction; else cancel the mission.",
    ),
    Rule(
        "I4 a mission has steps",
        select(missions.c.mission_id).where(
            missions.c.mission_id.not_in(select(mission_steps.c.mission_id))
        ),
        "Restore the steps from `instructions.body` of the mission's revision.",
    ),
    Rule(
        "I4 a mission that is not over has a link to its drone",
        select(missions.c.mission_id).where(
            is_open,
            ~exists().where(
                drone_links.c.drone_id == missions.c.drone_id,
                drone_links.c.provider_id == missions.c.provider_id,
            ),
        ),
        "Without the link no instruction is numbered and no event is followed. Restore the row of "
        "`drone_links` from a backup; its `stream` and `last_seq` are those of the drone's last "
        "instruction in `instructions`.",
    ),
    Rule(
        "I7 a booked mission waits for its drone's answer",
        select(missions.c.mission_id).where(
            missions.c.state == "BOOKED",
            # A mission in doubt waits for its drone's events, or for an operator.
            ~missions.c.body.contains('"doubt":{"code":'),
            ~exists().where(_is_of_mission, instructions.c.kind == "MISSION", _is_open),
        ),
        "The drone was never asked, or its answer was not followed. Cancel the mission (POST "
        "/v1/missions/{id}/commands with CANCEL): the gateway then books another drone.",
    ),
    Rule(
        "I7 a proposal waits for its drone's answer",
        _lost_proposals,
        "No answer will ever come for this revision. Set `missions.proposal` to NULL, and replan: "
        "the mission's `trouble` or `stuck` says why.",
    ),
    Rule(
        "a mission that needs a plan is looked at again within seconds",
        later_than(
            lambda survey: survey.wall_ms + _LONGEST_WAIT_MS, [missions.c.retry_wall_ms], is_live
        ),
        "Set `retry_wall_ms` to 0: the mission gets its next plan within a second.",
    ),
    Rule(
        "a mission in doubt has called an operator",
        rows_where(
            _WITHOUT_ALARM, lambda row: json.loads(row.body)["doubt"] is not None, "mission_id"
        ),
        "The alarm MISSION_IN_DOUBT was not raised, or its row was deleted. Find out where drone "
        "and packages are, and end the mission: POST /v1/missions/{id}/commands with GIVE_UP.",
    ),
    Rule(
        "a mission's columns say what its body says",
        rows_where(select(missions), _differs, "mission_id"),
        _AGAINST_BODY,
    ),
    Rule(
        "a mission that is over needs no plan",
        select(missions.c.mission_id).where(
            missions.c.state.not_in(LIVE_MISSION_STATES),
            or_(
                missions.c.stuck.is_not(None),
                missions.c.trouble.is_not(None),
                missions.c.proposal.is_not(None),
            ),
        ),
        "Its state was changed by hand. Find out from the drone's events (`mission_steps.event`) "
        "whether it is over, and restore the state or set these columns to NULL.",
    ),
    Rule(
        "a mission is checked when its next step should have ended",
        select(missions.c.mission_id).where(
            is_under_way,
            func.coalesce(missions.c.next_end_ms, 0) != func.coalesce(first_planned_end_ms, 0),
        ),
        "Set `next_end_ms` to the smallest `planned_end_ms` of the mission's PLANNED steps.",
    ),
    Rule(
        "a closed delivery has no mission that is not over",
        select(missions.c.mission_id)
        .join(deliveries, deliveries.c.delivery_id == missions.c.delivery_id)
        .where(deliveries.c.closed_ms.is_not(None), is_open),
        "The gateway has given the delivery up, so nobody waits for this mission. Cancel it: POST "
        "/v1/missions/{id}/commands with CANCEL.",
    ),
    Rule(
        "a withdrawn attempt has no mission that is not over",
        select(missions.c.mission_id)
        .join(deliveries, deliveries.c.delivery_id == missions.c.delivery_id)
        .where(missions.c.attempt <= deliveries.c.withdrawn_attempt, is_open),
        "The customer has changed the request since: nobody wants this mission. Cancel "
        "it: POST /v1/missions/{id}/commands with CANCEL.",
    ),
    Rule(
        "a mission that a drone has begun was accepted",
        select(missions.c.mission_id).where(
            missions.c.state.in_(("QUEUED", "BOOKED", "REFUSED")),
            exists().where(
                mission_steps.c.mission_id == missions.c.mission_id,
                mission_steps.c.status == "ENDED",
            ),
        ),
        "The state was set back by hand. The steps that have ended are the evidence: set the state "
        "to ACTIVE if its drone still flies it.",
    ),
)


class WaitingReport(NamedTuple):
    """A report in the outbox: its number, -1 if it is about another mission, and its attempts."""

    number: int
    attempts: int


async def waiting_reports(survey: Survey) -> Mapping[tuple[str, str], list[WaitingReport]]:
    """By service and mission: the reports that wait in the outbox, in order."""
    waiting: dict[tuple[str, str], list[WaitingReport]] = defaultdict(list)
    query = select(outbox).where(outbox.c.channel.in_(_RECEIVERS)).order_by(outbox.c.id)
    async for row in survey.each(query):
        report = readable(None, MissionReport.read, row.payload)
        number = report.seq if report is not None and report.mission_id == row.stream else -1
        waiting[row.channel, row.stream].append(WaitingReport(number, row.attempts))
    return waiting


async def _with_gaps(survey: Survey) -> set[str]:
    query = select(missions.c.mission_id, missions.c.report_seq)
    last = {row.mission_id: row.report_seq for row in await survey.rows(query)}
    for _, *of_guests in (await survey.once(shares_of)).values():
        last |= {each.mission_id: each.report_seq for each in of_guests}
    return {
        mission_id
        for (service, mission_id), reports in (await survey.once(waiting_reports)).items()
        for numbers in [[each.number for each in reports]]
        if not _is_whole(numbers, last.get(mission_id, 0), is_gapless=service == "gateway")
    }


def _is_whole(numbers: list[int], last: int, *, is_gapless: bool) -> bool:
    """Whether these are the last reports of a mission; the registry gets only some of them."""
    if is_gapless:
        return numbers == list(range(last - len(numbers) + 1, last + 1))
    return numbers == sorted(set(numbers)) and numbers[0] > 0 and numbers[-1] <= last


REPORTS: Final = (Rule("a mission's waiting reports are its last ones", _with_gaps, _RESTORE),)

#: What a provider sees: no-shows that happened, and alarms of its own missions.
NO_SHOWS: Final = (
    Rule(
        "an alarm of a mission is about its provider",
        select(alarms.c.alarm_id)
        .join(missions, missions.c.mission_id == alarms.c.mission_id)
        .where(
            alarms.c.provider_id != missions.c.provider_id,
            # The mission may have had this drone before another provider's.
            ~exists().where(
                drone_links.c.drone_id == alarms.c.drone_id,
                drone_links.c.provider_id == alarms.c.provider_id,
            ),
        ),
        "Set `provider_id` of the alarm to that of its mission: its provider sees it then.",
    ),
    Rule(
        "a no-show is a mission of its provider that was refused or aborted",
        select(no_shows.c.mission_id).where(
            ~exists().where(
                missions.c.mission_id == no_shows.c.mission_id,
                missions.c.provider_id == no_shows.c.provider_id,
                missions.c.drone_id == no_shows.c.drone_id,
                missions.c.state.in_(("REFUSED", "ABORTED")),
            )
        ),
        "The row of `no_shows` lowers the rank of its provider without a cause: delete it.",
    ),
)
