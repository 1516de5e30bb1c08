"""All SQL of the lateness of packages that were delivered."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Final, Literal

from sqlalchemy import (
    BigInteger,
    Integer,
    Select,
    and_,
    bindparam,
    case,
    func,
    not_,
    or_,
    select,
    true,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import NetworkId, ProviderId
from skyway.runtime.sql.connection import AnyRow
from skyway_gateway.delivery_tables import deliveries, is_live_row, missions, packages

#: The last packages of a provider in a network that count. Our own choice.
MOST_OF_PROVIDER: Final = 600

#: Whether the customer of a package allows no later delivery than promised. The dispatcher may plan
#: others later, which says nothing about how late a provider is. True or false, never null.
IS_DUE_AS_PROMISED: Final = or_(
    packages.c.due_ms.is_(None),
    packages.c.due_ms == func.coalesce(packages.c.promised_ms, -1),
    packages.c.due_ms == func.coalesce(packages.c.promised_p90_ms, -1),
)

_LAST: Final = (
    select(
        packages.c.delivery_id,
        packages.c.package_id,
        packages.c.promised_ms,
        packages.c.promised_p90_ms,
        packages.c.delivered_ms,
        missions.c.start_ms,
        missions.c.promised_on,
        missions.c.provider_id,
        deliveries.c.network_id,
        not_(IS_DUE_AS_PROMISED).label("allows_more"),
    )
    .join(missions, missions.c.mission_id == packages.c.mission_id)
    .join(deliveries, deliveries.c.delivery_id == packages.c.delivery_id)
    .where(
        packages.c.delivered_ms >= bindparam("since_ms", type_=BigInteger),
        packages.c.promised_ms.is_not(None),
        is_live_row(deliveries.c.customer_id),
    )
    .order_by(packages.c.delivered_ms.desc(), packages.c.delivery_id, packages.c.package_id)
    .limit(bindparam("most", type_=Integer))
    .subquery("last")
)
_place: Final = func.row_number().over(
    partition_by=(_LAST.c.network_id, _LAST.c.provider_id, _LAST.c.allows_more),
    order_by=(_LAST.c.delivered_ms.desc(), _LAST.c.delivery_id, _LAST.c.package_id),
)
_RANKED: Final = select(_LAST, _place.label("place")).subquery("ranked")
_DELIVERED: Final = (
    select(_RANKED)
    .where(_RANKED.c.place <= MOST_OF_PROVIDER)
    .order_by(_RANKED.c.delivered_ms, _RANKED.c.delivery_id, _RANKED.c.package_id)
)


async def delivered_since(
    connection: AsyncConnection, since_ms: int, *, most: int
) -> Sequence[AnyRow]:
    """The packages that were delivered at `since_ms` of fleet time or later, oldest first.

    The `most` last packages are read. Of each provider in each network at most the last
    `MOST_OF_PROVIDER` are kept, and as many of those whose customers allow more lateness.
    """
    found = await connection.execute(_DELIVERED, {"since_ms": since_ms, "most": most})
    return found.all()


#: The spans up to now for which the share of packages that came by their P90 is shown.
PromiseSpan = Literal["day", "week"]
_SPANS: Final[dict[PromiseSpan, timedelta]] = {"day": timedelta(days=1), "week": timedelta(days=7)}

#: The most pairs of network and provider that are shown, those with the most packages.
_MOST_PAIRS: Final = 500


@dataclass(frozen=True, slots=True)
class KeptPromises:
    """How many packages with a P90 a provider delivered in a network, and how many by then.

    Packages whose customers allow more are left out.
    """

    network_id: NetworkId | None
    provider_id: ProviderId
    packages: dict[PromiseSpan, int]
    in_time: dict[PromiseSpan, int]


def _kept() -> Select[*tuple[Any, ...]]:  # columns of every type
    delivered, p90 = packages.c.delivered_ms, packages.c.promised_p90_ms
    pair = (deliveries.c.network_id, missions.c.provider_id)
    is_of_day = delivered >= bindparam("day_ms", type_=BigInteger)
    is_in_time = delivered <= p90 + bindparam("host_delay_ms", type_=BigInteger)
    counted = {
        "day": is_of_day,
        "week": true(),
        "day_in_time": and_(is_of_day, is_in_time),
        "week_in_time": is_in_time,
    }
    return (
        select(
            *pair,
            *(func.sum(case((each, 1), else_=0)).label(name) for name, each in counted.items()),
        )
        .join_from(packages, missions, missions.c.mission_id == packages.c.mission_id)
        .join(deliveries, deliveries.c.delivery_id == packages.c.delivery_id)
        .where(
            delivered >= bindparam("week_ms", type_=BigInteger),
            p90.is_not(None),
            IS_DUE_AS_PROMISED,
            is_live_row(deliveries.c.customer_id),
        )
        .group_by(*pair)
        .order_by(func.count().desc(), *pair)
        .limit(_MOST_PAIRS)
    )


_KEPT: Final = _kept()


async def kept_promises(
    connection: AsyncConnection, *, now_ms: int, host_delay_ms: int
) -> Sequence[KeptPromises]:
    """The packages that came in the last day and week of fleet time, by network and provider.

    `host_delay_ms` is the lateness that does not count, as `host_delay` says.
    """
    since = {
        f"{name}_ms": now_ms - round(span.total_seconds() * 1000) for name, span in _SPANS.items()
    }
    # Sums of integers are decimals on PostgreSQL.
    return [
        KeptPromises(
            row.network_id,
            row.provider_id,
            packages={"day": int(row.day), "week": int(row.week)},
            in_time={"day": int(row.day_in_time), "week": int(row.week_in_time)},
        )
        for row in await connection.execute(_KEPT, since | {"host_delay_ms": host_delay_ms})
    ]
