"""Statistics of deliveries and of promises that were kept.

The database adds up, this file computes shares and means. 88 to 92 % of the packages should come by
their P90.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Final, Literal, Self

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.contracts.statistics import Span, SpanQuery
from skyway.delivery.lateness import ConditionsGroup, KnownBy, Weather
from skyway.errors import InvalidInput
from skyway.ids import NetworkId, ProviderId
from skyway.json_model import JsonModel
from skyway.units import hours_to_s, ms_to_moment
from skyway_gateway.lateness.lateness_forecast import Covered
from skyway_gateway.lateness.store import KeptPromises, PromiseSpan

Bucket = Literal["hour", "day"]

_BUCKET_MS: Final[Mapping[Bucket, int]] = {
    "hour": int(hours_to_s(1) * 1000),
    "day": int(hours_to_s(24) * 1000),
}
#: The most buckets of one answer.
_MOST_BUCKETS: Final = 1000

#: The upper ends of the ages, fleet seconds: a minute, 5, 15 and 60 minutes. Our own choice.
AGES_S: Final = (60, 300, 900, 3600)

Share = Annotated[float | None, Field(description="0 to 1; null when there is nothing to share")]
MeanSeconds = Annotated[float | None, Field(description="mean, fleet seconds")]


class DeliveryQuery(SpanQuery):
    """Which deliveries are counted, and in which buckets: full hours or days of UTC."""

    bucket: Annotated[
        Bucket | None,
        Field(description="Also give numbers for each full hour or day (UTC) of the span."),
    ] = None

    def bucket_ms(self, span: Span) -> int | None:
        """The length of a bucket; None without buckets.

        Raises
        ------
        InvalidInput
            There would be too many buckets.
        """
        if self.bucket is None:
            return None
        bucket_ms = _BUCKET_MS[self.bucket]
        if len(bucket_starts(span, bucket_ms)) > _MOST_BUCKETS:
            detail = f"more than {_MOST_BUCKETS} times a {self.bucket}: shorten the span"
            raise InvalidInput("bucket", detail)
        return bucket_ms


@dataclass(frozen=True, slots=True)
class Sums:
    """What the database has added up over a set of deliveries."""

    by_state: Mapping[str, int] = field(default_factory=dict)
    packages_delivered: int = 0
    packages_on_time: int = 0
    packages_with_p90: int = 0
    packages_by_p90: int = 0
    #: Over completed deliveries.
    completed: int = 0
    planned_ms: int = 0
    actual_ms: int = 0
    since_request_ms: int = 0
    #: Over missions that handed something over, from their start to their last hand-over.
    carried_ms: int = 0
    flight_s: float = 0.0
    waiting_s: float = 0.0
    recharging_s: float = 0.0

    def __add__(self, other: Self) -> "Sums":
        """The sums of both sets together."""
        added = {
            each.name: getattr(self, each.name) + getattr(other, each.name)
            for each in fields(self)
            if each.name != "by_state"
        }
        return Sums(by_state=Counter(self.by_state) + Counter(other.by_state), **added)


class DeliveryNumbers(JsonModel):
    """Numbers of a set of deliveries.

    A package is on time when it is handed over at most a minute after its `due_at`, which is the
    promised P90, or the promised P50 if the customer asked for that, later by what the customer
    allows (`may_be_later_s`), or the end of the package's window. Times of completed deliveries
    count from the planned start to the last hand-over. Shares are parts of that time over all
    missions; the remaining part is loading, handing over and starting late.
    """

    deliveries: Annotated[int, Field(description="How many deliveries were requested.")]
    by_state: Annotated[
        dict[str, int], Field(description="How many of them are in each state now.")
    ]
    packages_delivered: Annotated[int, Field(description="How many packages were delivered.")]
    packages_on_time: Annotated[
        int, Field(description="How many of them at most a minute after their `due_at`.")
    ]
    on_time_share: Share
    packages_with_p90: Annotated[
        int,
        Field(
            description="How many of them had a `promised_p90_at`, and customers who allow nothing "
            "later (by a package's window or `may_be_later_s`)."
        ),
    ]
    p90_share: Annotated[
        float | None,
        Field(
            description="The share of those that came by it; 0.88 to 0.92 is as it should be. Null "
            "without such packages."
        ),
    ]
    planned_s: MeanSeconds
    actual_s: MeanSeconds
    since_request_s: MeanSeconds
    flying_share: Share
    waiting_share: Share
    recharging_share: Share


class DeliveryBucket(DeliveryNumbers):
    """Numbers of the deliveries that were requested in [from, to)."""

    from_at: Annotated[FleetMoment, Field(alias="from")]
    to_at: Annotated[FleetMoment, Field(alias="to")]


class WaitingAge(JsonModel):
    """The requests of one age: older than the age before, and at most `up_to_s`."""

    up_to_s: Annotated[
        float | None, Field(description="Upper end of the age, seconds; null means no end.")
    ]
    requests: Annotated[int, Field(description="How many requests have waited this long.")]


class WaitingRequests(JsonModel):
    """The requests that no drone could serve yet. Their ages are in fleet time."""

    requests: Annotated[int, Field(description="How many requests wait for a drone now.")]
    oldest_s: Annotated[
        float | None, Field(description="How long the oldest has waited; null if none waits.")
    ]
    by_age: Annotated[
        tuple[WaitingAge, ...], Field(description="The requests by age, the newest first.")
    ]


def waiting_requests(
    by_age: Mapping[float | None, int], *, oldest_s: float | None
) -> WaitingRequests:
    """The answer, from the number of requests by the upper end of their age."""
    return WaitingRequests(
        requests=sum(by_age.values()),
        oldest_s=oldest_s,
        by_age=tuple(
            WaitingAge(up_to_s=up_to_s, requests=by_age.get(up_to_s, 0))
            for up_to_s in (*AGES_S, None)
        ),
    )


class DeliveryStatistics(DeliveryBucket):
    """Numbers of the whole span, and of each bucket in it, also of empty ones."""

    provider_id: Annotated[
        ProviderId | None,
        Field(description="Only deliveries that this provider flies; null for all."),
    ]
    bucket: Annotated[
        Bucket | None, Field(description="The length of the buckets; null without buckets.")
    ]
    buckets: Annotated[
        tuple[DeliveryBucket, ...], Field(description="The numbers of each bucket in the span.")
    ]
    waiting: Annotated[
        WaitingRequests | None,
        Field(
            description="The requests that wait for a drone now, whenever they were requested; "
            "null for a provider, because they have none yet."
        ),
    ]


def bucket_starts(span: Span, bucket_ms: int) -> Sequence[int]:
    """Where the buckets of a span begin, in milliseconds since 1970."""
    first = span.start_ms // bucket_ms * bucket_ms
    return range(first, span.end_ms, bucket_ms)


def numbers(sums: Sums) -> dict[str, object]:
    """The members of `DeliveryNumbers`."""
    carried_s = sums.carried_ms / 1000
    return {
        "deliveries": sum(sums.by_state.values()),
        "by_state": dict(sorted(sums.by_state.items())),
        "packages_delivered": sums.packages_delivered,
        "packages_on_time": sums.packages_on_time,
        "on_time_share": _per(sums.packages_on_time, sums.packages_delivered),
        "packages_with_p90": sums.packages_with_p90,
        "p90_share": _per(sums.packages_by_p90, sums.packages_with_p90),
        "planned_s": _per(sums.planned_ms / 1000, sums.completed),
        "actual_s": _per(sums.actual_ms / 1000, sums.completed),
        "since_request_s": _per(sums.since_request_ms / 1000, sums.completed),
        "flying_share": _per(sums.flight_s, carried_s),
        "waiting_share": _per(sums.waiting_s, carried_s),
        "recharging_share": _per(sums.recharging_s, carried_s),
    }


def statistics(
    found: Mapping[int, Sums],
    query: DeliveryQuery,
    *,
    span: Span,
    provider_id: ProviderId | None,
    waiting: WaitingRequests | None,
) -> DeliveryStatistics:
    """The answer, from sums by the beginning of their bucket (any key without buckets)."""
    bucket_ms = query.bucket_ms(span)
    starts = [] if bucket_ms is None else bucket_starts(span, bucket_ms)
    return DeliveryStatistics.model_validate(
        {
            "from": span.from_at,
            "to": span.to_at,
            "provider_id": provider_id,
            "bucket": query.bucket,
            **numbers(sum(found.values(), Sums())),
            "buckets": [
                {
                    # The span may begin and end within a bucket.
                    "from": ms_to_moment(max(start_ms, span.start_ms)),
                    "to": ms_to_moment(min(start_ms + (bucket_ms or 0), span.end_ms)),
                    **numbers(found.get(start_ms, Sums())),
                }
                for start_ms in starts
            ],
            "waiting": waiting,
        }
    )


def _per(amount: float, whole: float) -> float | None:
    return amount / whole if whole else None


class PromisesOfSpan(JsonModel):
    """The packages of a span that ends now."""

    packages: Annotated[
        int,
        Field(
            description="How many packages with a `promised_p90_at` were delivered, without those "
            "whose customers allow more (by a package's window or `may_be_later_s`)."
        ),
    ]
    p90_share: Annotated[
        float | None,
        Field(description="The share of them that came by it; null without such packages."),
    ]


class PromisesOfProvider(JsonModel):
    """The packages of a provider in a network, or of all providers of the network."""

    network_id: Annotated[
        NetworkId | None, Field(description="The network; null if it was not known.")
    ]
    provider_id: Annotated[
        ProviderId | None, Field(description="The provider; null for all of the network.")
    ]
    day: Annotated[PromisesOfSpan, Field(description="Delivered in the last day of fleet time.")]
    week: Annotated[PromisesOfSpan, Field(description="Delivered in the last week of fleet time.")]


class PromisesOfGroup(PromisesOfSpan):
    """The last packages that were promised under like conditions."""

    known_by: Annotated[
        KnownBy | None,
        Field(description="By what the weather was known; null if it was not known."),
    ]
    weather: Annotated[
        Weather | None,
        Field(
            description="COLD below 5 °C, else CALM below 2 m/s of wind, STORMY from 6 m/s on; "
            "null if it was not known."
        ),
    ]
    recharges: Annotated[
        int, Field(description="How many recharges the plan had; 3 stands for more too.")
    ]


class PromiseStatistics(JsonModel):
    """How promises at P90 were kept; each network before its providers."""

    at: Annotated[FleetMoment, Field(description="Moment of the answer, fleet time.")]
    items: Annotated[
        tuple[PromisesOfProvider, ...],
        Field(
            description="By network and provider: the 500 pairs with the most packages, and their "
            "networks. A provider sees only itself."
        ),
    ]
    groups: Annotated[
        tuple[PromisesOfGroup, ...],
        Field(
            description="The last packages, at most 600 of each provider in each network, by what "
            "was known of their plans. A provider sees only its own."
        ),
    ]


def groups_of(coverage: Mapping[ConditionsGroup, Covered]) -> tuple[PromisesOfGroup, ...]:
    """The coverage of each group, as it is shown."""
    return tuple(
        PromisesOfGroup(**group._asdict(), packages=packages, p90_share=in_time / packages)
        for group, (packages, in_time) in sorted(coverage.items(), key=str)
    )


def promises_of(
    rows: Sequence[KeptPromises], *, provider_id: ProviderId | None
) -> tuple[PromisesOfProvider, ...]:
    """What is shown to a provider about itself, or to operators about all networks."""
    if provider_id is not None:
        own = [each for each in rows if each.provider_id == provider_id]
        return tuple(_shown([each], each.provider_id) for each in sorted(own, key=_network_of))
    shown: list[PromisesOfProvider] = []
    for network in sorted({_network_of(each) for each in rows}):
        here = [each for each in rows if _network_of(each) == network]
        shown.append(_shown(here, None))
        shown.extend(
            _shown([each], each.provider_id)
            for each in sorted(here, key=lambda each: each.provider_id)
        )
    return tuple(shown)


def _network_of(row: KeptPromises) -> str:
    return row.network_id or ""


def _shown(rows: Sequence[KeptPromises], provider_id: ProviderId | None) -> PromisesOfProvider:
    return PromisesOfProvider(
        network_id=rows[0].network_id,
        provider_id=provider_id,
        day=_of_span(rows, "day"),
        week=_of_span(rows, "week"),
    )


def _of_span(rows: Iterable[KeptPromises], span: PromiseSpan) -> PromisesOfSpan:
    found = [(each.packages[span], each.in_time[span]) for each in rows]
    packages, in_time = (sum(column) for column in zip(*found, strict=True))
    return PromisesOfSpan(packages=packages, p90_share=in_time / packages if packages else None)
