"""All SQL of statistics: the database adds up the parts of steps that lie in the span."""

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
from skyway_composition.networks.store import by_bytes
from skyway_composition.tables import (
    better_orders,
    cut_steps,
    is_live,
    mission_steps,
    missions,
    outbox,
    stations,
)
from skyway_composition.tables.missions import DAY_MS

_Row = Row[*tuple[Any, ...]]  # columns of every type
_Query = Select[*tuple[Any, ...]]


@dataclass(frozen=True, slots=True)
class Selection:
    """Which steps are counted: those in a span, of one provider or of all."""

    span: Span
    provider_id: ProviderId | None

    @property
    def done(self) -> FromClause:
        """The steps in the span: steps that have ended, and steps that a new plan has cut short."""
        names = ("mission_id", "kind", "station_id", "started_ms", "ended_ms")
        # A step that was cut short is in both tables until another step gets its number.
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
        """Whether a mission belongs to the provider."""
        if self.provider_id is None:
            return true()
        return missions.c.provider_id == self.provider_id

    def within(self, start_ms: ColumnElement[int], end_ms: ColumnElement[int]) -> Any:
        """The part of an interval that lies in the span; an expression of milliseconds."""
        start, end = self.span.start_ms, self.span.end_ms
        return case((end_ms > end, end), else_=end_ms) - case(
            (start_ms < start, start), else_=start_ms
        )

    def time_on(self, done: FromClause, *kinds: str) -> ColumnElement[int]:
        """The time that steps of these kinds took within the span, milliseconds."""
        spent = self.within(done.c.started_ms, done.c.ended_ms)
        return func.sum(case((done.c.kind.in_(kinds), spent), else_=0))

    def time_beside_pads(self, done: FromClause, is_counted: ColumnElement[bool]) -> Any:
        """The time within the span that steps took which do not recharge, milliseconds."""
        spent = self.within(done.c.started_ms, done.c.ended_ms)
        return func.sum(case((is_counted & (done.c.kind != "RECHARGE"), spent), else_=0))

    def _is_in_span(self, steps: FromClause) -> ColumnElement[bool]:
        return and_(steps.c.ended_ms > self.span.start_ms, steps.c.started_ms < self.span.end_ms)


async def pad_sums(
    connection: AsyncConnection, selection: Selection, network_id: NetworkId | None
) -> _Row:
    """Sums of all stations: pads, sessions, charging_ms, waiting_ms; null without any step."""
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
    """The sums of each station, in order of the bytes of station ids, after a given id."""
    ids = by_bytes(connection, stations.c.station_id)
    statement = _stations(selection, network_id).order_by(ids).limit(limit)
    if after is not None:
        statement = statement.where(ids > after)
    return (await connection.execute(statement)).all()


async def drone_sums(connection: AsyncConnection, selection: Selection) -> _Row:
    """Sums of all drones: drones, missions and milliseconds; null without any mission."""
    each = _missions(selection)
    statement = select(func.count(distinct(each.c.drone_id)).label("drones"), *_sums(each))
    return (await connection.execute(statement)).one()


async def drones_page(
    connection: AsyncConnection, selection: Selection, *, after: str | None, limit: int
) -> Sequence[_Row]:
    """The sums of each drone that flew in the span, in order of drone ids, after a given id."""
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
    """Each mission with its drone, and the time it took for each kind of step and phase."""
    done = selection.done
    phases = _phases(done)
    first, last = func.min(done.c.started_ms), func.max(done.c.ended_ms)
    approached_ms = func.coalesce(phases.c.loaded_ms, phases.c.served_ms, done.c.ended_ms)
    is_before = done.c.started_ms < approached_ms
    is_after = done.c.started_ms >= phases.c.served_ms
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
            selection.time_beside_pads(done, is_before).label("approach_ms"),
            selection.time_beside_pads(done, is_after).label("standby_ms"),
        )
        .join(missions, missions.c.mission_id == done.c.mission_id)
        .join(phases, phases.c.mission_id == done.c.mission_id)
        .where(selection.is_own)
        .group_by(missions.c.mission_id, missions.c.drone_id, missions.c.provider_id)
        .subquery()
    )


def _phases(done: FromClause) -> FromClause:
    """When each mission loaded and had served: null as long as it has not.

    A mission has served when its last hand-over has ended and none is left.
    """
    steps = mission_steps
    is_hand_over = steps.c.kind.in_(("DELIVER", "RETURN"))
    left = func.sum(case((is_hand_over & steps.c.ended_ms.is_(None), 1), else_=0))
    handed_ms = func.max(case((is_hand_over, steps.c.ended_ms)))
    return (
        select(
            steps.c.mission_id,
            func.min(case((steps.c.kind == "PICK_UP", steps.c.started_ms))).label("loaded_ms"),
            case((left == 0, handed_ms)).label("served_ms"),
        )
        .where(steps.c.mission_id.in_(select(done.c.mission_id)))
        .group_by(steps.c.mission_id)
        .subquery("phases")
    )


def _sums(each: FromClause) -> list[ColumnElement[Any]]:  # numbers of either kind
    names = (
        "busy_ms",
        "flying_ms",
        "recharging_ms",
        "loading_ms",
        "delivering_ms",
        "approach_ms",
        "standby_ms",
    )
    return [
        func.count().label("missions"),
        *(func.sum(each.c[name]).label(name) for name in names),
    ]


async def live_missions(
    connection: AsyncConnection, provider_id: ProviderId | None
) -> Mapping[str, int]:
    """The number of missions that are not over, by state."""
    query = select(missions.c.state, func.count()).where(is_live).group_by(missions.c.state)
    if provider_id is not None:
        query = query.where(missions.c.provider_id == provider_id)
    return dict((await connection.execute(query)).all())


async def unsent(connection: AsyncConnection) -> Mapping[str, int]:
    """The number of messages that wait in the outbox, by channel."""
    query = select(outbox.c.channel, func.count()).group_by(outbox.c.channel)
    return dict((await connection.execute(query)).all())


async def better_orders_of(
    connection: AsyncConnection, provider_id: ProviderId | None, *, since_ms: int
) -> Mapping[ProviderId, tuple[int, int]]:
    """By provider: how many better orders were adopted since then, and the milliseconds saved.

    Whole days count, fleet time: the day of `since_ms` too.
    """
    query = (
        select(
            better_orders.c.provider_id,
            func.sum(better_orders.c.orders),
            func.sum(better_orders.c.saved_ms),
        )
        .where(better_orders.c.day_ms > since_ms - DAY_MS)
        .group_by(better_orders.c.provider_id)
    )
    if provider_id is not None:
        query = query.where(better_orders.c.provider_id == provider_id)
    rows = await connection.execute(query)
    return {ProviderId(row[0]): (int(row[1]), int(row[2])) for row in rows}
