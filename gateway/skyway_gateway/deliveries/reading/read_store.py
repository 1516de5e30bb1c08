"""The SQL of lists of deliveries, of earnings and of statistics.

Lists hold only what the caller may see. Of statistics the database returns one row for each bucket.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Annotated, Any, Final

from pydantic import Field
from sqlalchemy import (
    ColumnElement,
    FromClause,
    Select,
    and_,
    case,
    distinct,
    exists,
    func,
    literal,
    select,
    true,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.statistics import Span
from skyway.ids import ProviderId
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.store import owned
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, DeliveryState
from skyway_gateway.deliveries.lifecycle.delivery_parts import Waiting
from skyway_gateway.deliveries.reading.statistics import (
    AGES_S,
    Sums,
    WaitingRequests,
    waiting_requests,
)
from skyway_gateway.deliveries.reading.views import DayEarnings, EarningsQuery
from skyway_gateway.deliveries.records.delivery_store import with_parts
from skyway_gateway.delivery_tables import deliveries, is_live_row, missions, packages
from skyway_gateway.lateness.store import IS_DUE_AS_PROMISED
from skyway_gateway.tables import ledger


class DeliveryListQuery(PageQuery):
    """The query of the list of deliveries."""

    state: Annotated[DeliveryState | None, Field(description="Only deliveries in this state.")] = (
        None
    )
    reference: Annotated[
        str | None,
        Field(max_length=200, description="Only deliveries with this reference of the customer's."),
    ] = None


async def page_of(
    connection: AsyncConnection, caller: Caller, query: DeliveryListQuery
) -> Sequence[Delivery]:
    """Up to limit + 1 of the caller's deliveries, the newest first."""
    statement = select(deliveries).where(owned(caller, deliveries.c.customer_id))
    if query.state is not None:
        statement = statement.where(deliveries.c.state == query.state)
    if query.reference is not None:
        statement = statement.where(deliveries.c.reference == query.reference)
    return await _page(connection, statement, query)


async def page_of_provider(
    connection: AsyncConnection, provider_id: ProviderId, query: PageQuery
) -> Sequence[Delivery]:
    """Up to limit + 1 deliveries that a provider's drones fly, with only what these drones do."""
    is_flown = exists().where(
        missions.c.delivery_id == deliveries.c.delivery_id,
        missions.c.provider_id == provider_id,
        missions.c.state != "REFUSED",
    )
    found = await _page(connection, select(deliveries).where(is_flown), query)
    return [_part_of(provider_id, delivery) for delivery in found]


def _part_of(provider_id: ProviderId, delivery: Delivery) -> Delivery:
    """The delivery with the missions, packages and activity of one provider's drones."""
    own = tuple(one for one in delivery.missions if one.provider_id == provider_id)
    mission_ids = {mission.mission_id for mission in own}
    packages = tuple(one for one in delivery.packages if one.mission_id in mission_ids)
    # A delivery has one activity: the latest report of any of its drones.
    activity = delivery.activity if len(own) == len(delivery.missions) else None
    changes = {"missions": own, "packages": packages, "activity": activity}
    return delivery.model_copy(update=changes)


_place = func.row_number().over(
    partition_by=(deliveries.c.network_id, deliveries.c.queue_rank),
    order_by=(deliveries.c.created_ms, deliveries.c.delivery_id),
)
_PLACES: Final = (
    select(deliveries.c.delivery_id, deliveries.c.waits_since_ms, _place.label("place"))
    .where(deliveries.c.waits_since_ms.is_not(None))
    .subquery()
)


async def with_places(connection: AsyncConnection, found: Sequence[Delivery]) -> Sequence[Delivery]:
    """The deliveries; those that wait for a drone show their place."""
    queued = [delivery.delivery_id for delivery in found if delivery.is_queued]
    if not queued:
        return found
    statement = select(_PLACES).where(_PLACES.c.delivery_id.in_(queued))
    rows = {row.delivery_id: row for row in await connection.execute(statement)}
    return [_with_place(delivery, rows.get(delivery.delivery_id)) for delivery in found]


def _with_place(delivery: Delivery, row: AnyRow | None) -> Delivery:
    waiting = row and Waiting(
        place=row.place,
        since_at=ms_to_moment(row.waits_since_ms),
        earliest_start_at=Waiting.earliest_start(delivery.reasons),
    )
    return delivery.model_copy(update={"waiting": waiting})


async def _page(
    connection: AsyncConnection, statement: Select[*tuple[Any, ...]], query: PageQuery
) -> Sequence[Delivery]:
    if (after := query.after_id()) is not None:
        statement = statement.where(deliveries.c.delivery_id < after)
    statement = statement.order_by(deliveries.c.delivery_id.desc()).limit(query.limit + 1)
    return await with_parts(connection, (await connection.execute(statement)).all())


_DAY_MS: Final = 86_400_000
_FIRST_DAY: Final = date(1970, 1, 1)


async def days_of(
    connection: AsyncConnection, provider_id: ProviderId, query: EarningsQuery
) -> tuple[DayEarnings, ...]:
    """The sums of a provider's lines of the ledger by the day of writing, the first day first."""
    day = (ledger.c.at_ms // _DAY_MS).label("day")
    statement = select(
        day,
        ledger.c.currency,
        func.count(distinct(ledger.c.delivery_id)).label("deliveries"),
        func.count(distinct(ledger.c.mission_id)).label("missions"),
        func.sum(ledger.c.amount).label("amount"),
    ).where(ledger.c.provider_id == provider_id)
    if query.from_at is not None:
        statement = statement.where(ledger.c.at_ms >= moment_to_ms(query.from_at))
    if query.to_at is not None:
        statement = statement.where(ledger.c.at_ms < moment_to_ms(query.to_at))
    # The currency used last comes last within its day.
    statement = statement.group_by(day, ledger.c.currency).order_by(day, func.max(ledger.c.at_ms))
    return tuple(
        DayEarnings(
            day=_FIRST_DAY + timedelta(days=row.day),
            currency=row.currency,
            deliveries=row.deliveries,
            missions=row.missions,
            amount=int(row.amount),
        )
        for row in await connection.execute(statement)
    )


#: A package that is handed over at most this late is on time, milliseconds of fleet time.
_ON_TIME_MS: Final = 60_000

_Query = Select[*tuple[Any, ...]]  # columns of every type


@dataclass(frozen=True, slots=True)
class Counted:
    """Which deliveries count: requested in a span and, if given, flown by a provider.

    `host_delay_ms` is the lateness that does not count, as `host_delay` says.
    """

    span: Span
    provider_id: ProviderId | None
    bucket_ms: int | None
    host_delay_ms: int

    @property
    def bucket(self) -> ColumnElement[int]:
        """The beginning of the bucket in which a delivery was counted."""
        if self.bucket_ms is None:
            return literal(0)
        created: ColumnElement[int] = deliveries.c.created_ms
        return created // self.bucket_ms * self.bucket_ms

    @property
    def is_counted(self) -> ColumnElement[bool]:
        """Whether a delivery counts."""
        created = deliveries.c.created_ms
        is_in_span = and_(
            created >= self.span.start_ms,
            created < self.span.end_ms,
            is_live_row(deliveries.c.customer_id),
        )
        if self.provider_id is None:
            return is_in_span
        # An alias, because the statement around it may use the missions table itself.
        own = missions.alias("own")
        is_own = and_(own.c.delivery_id == deliveries.c.delivery_id, self.is_flown(own))
        return and_(is_in_span, exists().where(is_own))

    def is_flown(self, flown: FromClause) -> ColumnElement[bool]:
        """Whether a mission counts; a refused mission was never flown."""
        is_own = true() if self.provider_id is None else flown.c.provider_id == self.provider_id
        return and_(flown.c.state != "REFUSED", is_own)


async def sums(connection: AsyncConnection, counted: Counted) -> Mapping[int, Sums]:
    """The sums by the beginning of their bucket; the key is 0 without buckets."""
    states: defaultdict[int, Counter[str]] = defaultdict(Counter)
    for row in await connection.execute(_state_counts(counted)):
        states[row.bucket][row.state] = row.deliveries
    found = {bucket: Sums(by_state=by_state) for bucket, by_state in states.items()}
    for statement in (_package_sums(counted), _time_sums(counted), _mission_sums(counted)):
        for row in await connection.execute(statement):
            # Sums of integers are decimals on PostgreSQL.
            values: dict[str, Any] = {
                name: value if isinstance(value, float) else int(value)
                for name, value in row._mapping.items()
            }
            bucket = values.pop("bucket")
            found[bucket] = found.get(bucket, Sums()) + Sums(**values)
    return found


def _state_counts(counted: Counted) -> _Query:
    bucket = counted.bucket.label("bucket")
    return (
        select(bucket, deliveries.c.state, func.count().label("deliveries"))
        .where(counted.is_counted)
        .group_by(bucket, deliveries.c.state)
    )


def _package_sums(counted: Counted) -> _Query:
    bucket = counted.bucket.label("bucket")
    delivered = packages.c.delivered_ms - counted.host_delay_ms
    due = func.coalesce(packages.c.due_ms, packages.c.promised_ms)
    is_on_time = delivered <= due + _ON_TIME_MS
    p90 = packages.c.promised_p90_ms
    has_p90 = and_(p90.is_not(None), IS_DUE_AS_PROMISED)
    statement = (
        select(
            bucket,
            func.count().label("packages_delivered"),
            func.sum(case((is_on_time, 1), else_=0)).label("packages_on_time"),
            func.sum(case((has_p90, 1), else_=0)).label("packages_with_p90"),
            func.sum(case((and_(has_p90, delivered <= p90), 1), else_=0)).label("packages_by_p90"),
        )
        .join_from(deliveries, packages, packages.c.delivery_id == deliveries.c.delivery_id)
        .where(counted.is_counted, delivered.is_not(None))
        .group_by(bucket)
    )
    if counted.provider_id is None:
        return statement
    # A delivery of several trips may be flown by several providers.
    return statement.join(missions, missions.c.mission_id == packages.c.mission_id).where(
        counted.is_flown(missions)
    )


def _time_sums(counted: Counted) -> _Query:
    """Planned and actual times of completed deliveries."""
    each = (
        select(
            counted.bucket.label("bucket"),
            deliveries.c.created_ms,
            func.min(missions.c.start_ms).label("start_ms"),
            func.max(packages.c.promised_ms).label("promised_ms"),
            func.max(packages.c.delivered_ms).label("delivered_ms"),
        )
        # This joins each package with each mission, which changes neither minimum nor maximum.
        .join_from(deliveries, packages, packages.c.delivery_id == deliveries.c.delivery_id)
        .join(missions, missions.c.delivery_id == deliveries.c.delivery_id)
        .where(
            counted.is_counted,
            deliveries.c.state == "COMPLETED",
            missions.c.state != "REFUSED",
            packages.c.promised_ms.is_not(None),
        )
        .group_by(deliveries.c.delivery_id)
        .subquery()
    )
    return select(
        each.c.bucket,
        func.count().label("completed"),
        func.sum(each.c.promised_ms - each.c.start_ms).label("planned_ms"),
        func.sum(each.c.delivered_ms - each.c.start_ms).label("actual_ms"),
        func.sum(each.c.delivered_ms - each.c.created_ms).label("since_request_ms"),
    ).group_by(each.c.bucket)


def _mission_sums(counted: Counted) -> _Query:
    """Times of missions that handed something over, up to their last hand-over."""
    names = ("flight_s", "waiting_s", "recharging_s")
    is_carried = and_(
        packages.c.delivery_id == missions.c.delivery_id,
        packages.c.mission_id == missions.c.mission_id,
        packages.c.delivered_ms.is_not(None),
    )
    each = (
        select(
            counted.bucket.label("bucket"),
            (func.max(packages.c.delivered_ms) - missions.c.start_ms).label("carried_ms"),
            *(missions.c[name] for name in names),
        )
        .join_from(deliveries, missions, missions.c.delivery_id == deliveries.c.delivery_id)
        .join(packages, is_carried)
        .where(counted.is_counted, counted.is_flown(missions), missions.c.flight_s.is_not(None))
        .group_by(missions.c.mission_id, deliveries.c.delivery_id)
        .subquery()
    )
    added = (func.sum(each.c[name]).label(name) for name in ("carried_ms", *names))
    return select(each.c.bucket, *added).group_by(each.c.bucket)


async def waiting(connection: AsyncConnection, *, now_ms: int) -> WaitingRequests:
    """The requests that wait for a drone at this moment of fleet time, by age."""
    since = deliveries.c.waits_since_ms
    age = case(*((since >= now_ms - 1000 * up_to_s, up_to_s) for up_to_s in AGES_S)).label("age")
    statement = (
        select(age, func.count().label("requests"), func.min(since).label("first_ms"))
        .where(since.is_not(None), is_live_row(deliveries.c.customer_id))
        .group_by(age)
    )
    rows = (await connection.execute(statement)).all()
    first_ms = min((row.first_ms for row in rows), default=None)
    oldest_s = None if first_ms is None else max(0, now_ms - first_ms) / 1000
    return waiting_requests({row.age: row.requests for row in rows}, oldest_s=oldest_s)
