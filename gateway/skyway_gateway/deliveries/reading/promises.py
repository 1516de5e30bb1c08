"""How many packages came by their P90, by network and provider: 88 to 92 % is as it should be."""

from collections.abc import Iterable, Sequence
from typing import Annotated

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.ids import NetworkId, ProviderId
from skyway.json_model import JsonModel
from skyway_gateway.lateness.store import KeptPromises, PromiseSpan


class PromisesOfSpan(JsonModel):
    """The packages of a span that ends now."""

    packages: Annotated[
        int,
        Field(
            description="How many packages with a `promised_p90_at` were delivered, without those "
            "whose customers allow more (`may_be_later_s`)."
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
