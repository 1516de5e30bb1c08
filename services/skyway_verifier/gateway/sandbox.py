"""The rules of the missions of test deliveries, which the gateway plays itself."""

from typing import Any, Final

from skyway_gateway.delivery_tables import deliveries, missions
from skyway_gateway.sandbox.store import REPORTS
from skyway_gateway.tables import sandbox_missions
from sqlalchemy import select

from skyway.contracts.mission import Mission
from skyway.ids import is_live_account, is_live_id
from skyway_verifier.finders import readable
from skyway_verifier.rule import Rule, Survey

_DELETE: Final = "Delete the delivery of this row with all its parts: it is a test delivery."


async def _mixed(survey: Survey) -> list[str]:
    """Deliveries whose id says another mode than their customer."""
    query = select(deliveries.c.delivery_id, deliveries.c.customer_id)
    return [
        row.delivery_id
        async for row in survey.each(query)
        if is_live_id(row.delivery_id) != is_live_account(row.customer_id)
    ]


async def _wrong_scripts(survey: Survey) -> list[str]:
    """Missions of the sandbox whose columns, plan and reports do not belong together."""
    played = select(missions.c.mission_id, missions.c.report_seq).where(
        missions.c.mission_id.in_(select(sandbox_missions.c.mission_id))
    )
    applied = {row.mission_id: row.report_seq for row in await survey.rows(played)}
    return [
        row.mission_id
        async for row in survey.each(select(sandbox_missions))
        if is_live_id(row.delivery_id)
        or not readable(True, _belongs, row, applied.get(row.mission_id))
    ]


def _belongs(row: Any, applied: int | None) -> bool:  # a row of sandbox_missions
    mission, reports = Mission.read(row.mission), REPORTS.validate_json(row.reports)
    key = row.mission_id, row.delivery_id, row.attempt
    is_waiting = row.next_wall_ms is not None
    return (
        (mission.mission_id, mission.delivery_id, mission.attempt) == key
        and [each.seq for each in reports] == [*range(1, len(reports) + 1)]
        and all((each.mission_id, each.delivery_id) == key[:2] for each in reports)
        and row.played <= len(reports)
        # A booking that a change has overtaken is not known to its delivery.
        and (applied is None or applied <= row.played)
        and (is_waiting or applied in (None, row.played))
        and (is_waiting or row.played == len(reports))
    )


SANDBOX: Final = (
    Rule("a delivery's id says whether its customer is a test account", _mixed, _DELETE),
    Rule("a test delivery has the reports of its own missions, in order", _wrong_scripts, _DELETE),
)
