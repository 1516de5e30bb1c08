"""The rules of money: what missions are charged, the lines of the ledger, and closed months."""

from collections import defaultdict
from datetime import timedelta
from typing import Any, Final

from skyway_gateway.deliveries.lifecycle.charges import charge_of
from skyway_gateway.deliveries.lifecycle.delivery import SETTLED_PACKAGE_STATES, PackageStatus
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission
from skyway_gateway.deliveries.records.delivery_rows import package_of
from skyway_gateway.delivery_tables import deliveries, missions, packages
from skyway_gateway.ledger.line import month_of
from skyway_gateway.tables import closed_months, closed_totals, ledger
from sqlalchemy import and_, exists, func, or_, select

from skyway.delivery.offer import Price
from skyway.units import ms_to_moment
from skyway_verifier.finders import readable, rows_where
from skyway_verifier.rule import Rule, Survey

_is_carried = packages.c.mission_id == missions.c.mission_id
_is_open = exists().where(_is_carried, packages.c.state.not_in(sorted(SETTLED_PACKAGE_STATES)))

_BY_EVENTS: Final = (
    "Three places say what was charged: `charged` in `missions.body`, the delivery's last event, "
    "and the lines of `ledger`. Set the value that differs to that of the other two."
)

_RESTORE: Final = "Restore the rows from a backup: lines are only added, and never change."


async def _charged_otherwise(survey: Survey) -> list[str]:
    """Missions with another charge than their price, terms and packages give."""
    carried: dict[str, list[PackageStatus]] = defaultdict(list)
    is_charged = missions.c.charged_amount.is_not(None)
    query = select(packages).join(missions, _is_carried).where(is_charged)
    async for row in survey.each(query):
        if (package := readable(None, package_of, row)) is not None:
            carried[package.mission_id or ""].append(package)
    query = select(missions).where(is_charged)
    return [
        row.mission_id
        async for row in survey.each(query)
        if readable(False, _is_charged_otherwise, row, carried[row.mission_id])
    ]


def _is_charged_otherwise(row: Any, carried: list[PackageStatus]) -> bool:  # a row of missions
    mission = FlownMission.read(row.body)
    if mission.charged is None or mission.charged.amount != row.charged_amount or not carried:
        return True
    # Lateness that a slow machine may have caused did not count then.
    least = charge_of(mission, carried, timedelta(0))
    is_less = mission.charged.amount < least.amount
    return is_less or _without_lateness(mission.charged) != _without_lateness(least)


def _without_lateness(price: Price) -> dict[str, int]:
    return {each.kind: each.amount for each in price.itemised if each.kind != "LATENESS"}


async def _other_lines(survey: Survey) -> list[str]:
    """Missions whose lines, without corrections, are not the line items of their charge."""
    lines: dict[str, list[tuple[str, int]]] = defaultdict(list)
    query = select(ledger).where(ledger.c.kind != "CORRECTION").order_by(ledger.c.number)
    async for row in survey.each(query):
        lines[row.mission_id].append((row.kind, row.amount))
    return [
        row.mission_id
        async for row in survey.each(select(missions))
        if readable(False, _has_other_lines, row, lines[row.mission_id])
    ]


def _has_other_lines(row: Any, lines: list[tuple[str, int]]) -> bool:  # a row of missions
    charged = FlownMission.read(row.body).charged
    items = () if charged is None else charged.itemised
    return lines != [(each.kind, each.amount) for each in items]


async def _other_totals(survey: Survey) -> list[str]:
    """Totals of closed months that are not the sums of their lines."""
    is_closed = closed_months.c.month == ledger.c.month
    sums: dict[tuple[str, ...], tuple[int, int]] = {}
    for role, party in (("customer", ledger.c.customer_id), ("provider", ledger.c.provider_id)):
        key = (ledger.c.month, party, ledger.c.currency)
        query = select(*key, func.sum(ledger.c.amount), func.count()).join(closed_months, is_closed)
        for month, party_id, currency, amount, lines in await survey.rows(query.group_by(*key)):
            sums[month, role, party_id, currency] = (int(amount), lines)
    stored: dict[tuple[str, ...], tuple[int, int]] = {
        (row.month, row.role, row.party_id, row.currency): (row.amount, row.lines)
        async for row in survey.each(select(closed_totals))
    }
    keys = sums.keys() | stored.keys()
    return ["/".join(key) for key in sorted(keys) if sums.get(key) != stored.get(key)]


LEDGER: Final = (
    Rule(
        "a mission is charged once all its packages are settled",
        select(missions.c.mission_id).where(
            or_(
                and_(missions.c.charged_amount.is_not(None), _is_open),
                and_(
                    missions.c.charged_amount.is_(None),
                    missions.c.state != "REFUSED",
                    exists().where(_is_carried),
                    ~_is_open,
                ),
            )
        ),
        _BY_EVENTS,
    ),
    Rule(
        "a mission is charged as its price, its terms and its packages say",
        _charged_otherwise,
        _BY_EVENTS,
    ),
    Rule(
        "the lines of a mission are the items of its charge",
        _other_lines,
        _BY_EVENTS,
    ),
    Rule(
        "a line names the parties of its mission",
        select(ledger.c.mission_id)
        .join(missions, missions.c.mission_id == ledger.c.mission_id)
        .join(deliveries, deliveries.c.delivery_id == missions.c.delivery_id)
        .where(
            or_(
                ledger.c.delivery_id != missions.c.delivery_id,
                ledger.c.provider_id != missions.c.provider_id,
                ledger.c.customer_id != deliveries.c.customer_id,
                ledger.c.currency != missions.c.currency,
            )
        ),
        "The delivery and its mission say who paid whom: set the columns of the line to theirs.",
    ),
    Rule(
        "the lines of a mission have no gap, and name the same parties",
        select(ledger.c.mission_id)
        .group_by(ledger.c.mission_id)
        .having(
            or_(
                func.max(ledger.c.number) != func.count(),
                *(
                    func.min(column) != func.max(column)
                    for column in (
                        ledger.c.delivery_id,
                        ledger.c.customer_id,
                        ledger.c.provider_id,
                        ledger.c.currency,
                    )
                ),
                func.sum(ledger.c.amount) < 0,
                func.count().filter((ledger.c.kind == "CORRECTION") != ledger.c.note.is_not(None))
                > 0,
            )
        ),
        _RESTORE,
    ),
    Rule(
        "a line counts in the month in which it was written",
        rows_where(
            select(ledger),
            lambda row: row.month != month_of(ms_to_moment(row.at_ms)),
            "mission_id",
            "number",
        ),
        "Set `month` to that of `at_ms`, unless a closed month would change.",
    ),
    Rule(
        "a month is closed after its end",
        rows_where(
            select(closed_months),
            lambda row: month_of(ms_to_moment(row.closed_ms)) <= row.month,
            "month",
        ),
        "Delete the month from `closed_totals` and `closed_months`: it is closed again in time.",
    ),
    Rule(
        "the totals of a closed month are the sums of its lines",
        _other_totals,
        "Both parties have seen the totals. If the lines add up to the charges of their missions, "
        "set the total to their sum; else restore the lines from a backup.",
    ),
)
