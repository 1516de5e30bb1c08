"""All SQL of statistics: steps that have ended, cut to the span and added up by the database."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import (
    ColumnElement,
    FromClause,
    Row,
    Select,
    and_,
    case,
    distinct,
    exists,
    func,
    select,
    true,
    union_all,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.statistics import Span
from skyway.ids import NetworkId, ProviderId
from skyway_composition.tables import cut_steps, is_live, mission_steps, missions, outbox, stations

_Row = Row[*tuple[Any, ...]]  # columns of every type
_Query = Select[*tuple[Any, ...]]


@dataclass(frozen=True, slots=True)
class Selection:
    """Whose steps in which span."""

    span: Span
    provider_id: ProviderId | None

    @property
    def done(self) -> FromClause:
        """What was done in the span: steps that have ended, and those that a new plan has cut."""
        names = ("mission_id", "kind", "station_id", "started_ms", "ended_ms")
        # A step is in both tables from when it was cut until its number is another's.
        is_kept = exists().where(
            cut_steps.c.mission_id == mission_steps.c.mission_id,
            cut_steps.c.step_id == mission_steps.c.step_id,
            cut_steps.c.ended_ms == mission_steps.c.ended_ms,
        )
        ended = select(*(mission_steps.c[name] for name in names)).where(
            self._is_in_span(mission_steps), ~is_kept
        )
        cut = select(*(cut_steps.c[name] for name in names)).where(self._is_in_span(cut_steps))
        return union_all(ended, cut).subquery("done")

    @property
    def is_own(self) -> ColumnElement[bool]:
        """Whether a mission is theirs."""
        if self.provider_id is None:
            return true()
        return missions.c.provider_id == self.provider_id

    def within(self, start_ms: ColumnElement[int], end_ms: ColumnElement[int]) -> Any:
        """How much of a time lies in the span; an expression of milliseconds."""
        start, end = self.span.start_ms, self.span.end_ms
        return case((end_ms > end, end), else_=end_ms) - case(
            (start_ms < start, start), else_=start_ms
        )

    def time_on(self, done: FromClause, *kinds: str) -> ColumnElement[int]:
        """How much of the span went into steps of these kinds, milliseconds."""
        spent = self.within(done.c.started_ms, done.c.ended_ms)
        return func.sum(case((done.c.kind.in_(kinds), spent), else_=0))

    def _is_in_span(self, steps: FromClause) -> ColumnElement[bool]:
        return and_(steps.c.ended_ms > self.span.start_ms, steps.c.started_ms < self.span.end_ms)


async def pad_sums(
    connection: AsyncConnection, selection: Selection, network_id: NetworkId | None
) -> _Row:
    """All stations together: pads, sessions, charging_ms, waiting_ms; null where nothing was."""
    each = _stations(selection, network_id).subquery()
    names = ("pads", "sessions", "charging_ms", "waiting_ms")
    statement = select(*(func.sum(each.c[name]).label(name) for name in names))
    return (await connection.execute(statement)).one()


async def pads_page(
    connection: AsyncConnection,
    selection: Selection,
    network_id: NetworkId | None,
    *,
    after: str | None,
    limit: int,
) -> Sequence[_Row]:
    """The same of each station, by station id, of those after this one."""
    statement = _stations(selection, network_id).order_by(stations.c.station_id).limit(limit)
    if after is not None:
        statement = statement.where(stations.c.station_id > after)
    return (await connection.execute(statement)).all()


async def drone_sums(connection: AsyncConnection, selection: Selection) -> _Row:
    """All drones together: drones, missions and milliseconds; null where nothing was."""
    each = _missions(selection)
    statement = select(func.count(distinct(each.c.drone_id)).label("drones"), *_sums(each))
    return (await connection.execute(statement)).one()


async def drones_page(
    connection: AsyncConnection, selection: Selection, *, after: str | None, limit: int
) -> Sequence[_Row]:
    """The same of each drone that flew in the span, by drone id, of those after this one."""
    each = _missions(selection)
    statement = (
        select(each.c.drone_id, each.c.provider_id, *_sums(each))
        .group_by(each.c.drone_id, each.c.provider_id)
        .order_by(each.c.drone_id)
        .limit(limit)
    )
    if after is not None:
        statement = statement.where(each.c.drone_id > after)
    return (await connection.execute(statement)).all()


def _stations(selection: Selection, network_id: NetworkId | None) -> _Query:
    done = selection.done
    used = (
        select(
            done.c.station_id,
            func.sum(case((done.c.kind == "RECHARGE", 1), else_=0)).label("sessions"),
            selection.time_on(done, "RECHARGE").label("charging_ms"),
            selection.time_on(done, "WAIT").label("waiting_ms"),
        )
        .join(missions, missions.c.mission_id == done.c.mission_id)
        .where(selection.is_own, done.c.kind.in_(("RECHARGE", "WAIT")))
        .group_by(done.c.station_id)
        .subquery()
    )
    statement = select(
        stations.c.station_id,
        stations.c.network_id,
        stations.c.pads,
        used.c.sessions,
        used.c.charging_ms,
        used.c.waiting_ms,
    ).outerjoin_from(stations, used, used.c.station_id == stations.c.station_id)
    return statement if network_id is None else statement.where(stations.c.network_id == network_id)


def _missions(selection: Selection) -> FromClause:
    """Each mission's drone, and what it spent the span on."""
    done = selection.done
    first, last = func.min(done.c.started_ms), func.max(done.c.ended_ms)
    return (
        select(
            missions.c.mission_id,
            missions.c.drone_id,
            missions.c.provider_id,
            selection.within(first, last).label("busy_ms"),
            selection.time_on(done, "FLY").label("flying_ms"),
            selection.time_on(done, "RECHARGE").label("recharging_ms"),
            selection.time_on(done, "PICK_UP").label("loading_ms"),
            selection.time_on(done, "DELIVER", "RETURN").label("delivering_ms"),
        )
        .join(missions, missions.c.mission_id == done.c.mission_id)
        .where(selection.is_own)
        .group_by(missions.c.mission_id, missions.c.drone_id, missions.c.provider_id)
        .subquery()
    )


def _sums(each: FromClause) -> list[ColumnElement[Any]]:  # numbers of either kind
    names = ("busy_ms", "flying_ms", "recharging_ms", "loading_ms", "delivering_ms")
    return [
        func.count().label("missions"),
        *(func.sum(each.c[name]).label(name) for name in names),
    ]


async def live_missions(
    connection: AsyncConnection, provider_id: ProviderId | None
) -> Mapping[str, int]:
    """How many missions that are not over are in which state."""
    query = select(missions.c.state, func.count()).where(is_live).group_by(missions.c.state)
    if provider_id is not None:
        query = query.where(missions.c.provider_id == provider_id)
    return dict((await connection.execute(query)).all())


async def unsent(connection: AsyncConnection) -> Mapping[str, int]:
    """How many messages wait in the outbox, by channel."""
    query = select(outbox.c.channel, func.count()).group_by(outbox.c.channel)
    return dict((await connection.execute(query)).all())
