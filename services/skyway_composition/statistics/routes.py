"""Statistics of pads, drones and missions over REST: operators see all, a provider its own."""

from typing import Annotated

from fastapi import Depends, Query
from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.contracts.statistics import Span
from skyway.ids import ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.planning.no_show_store import COUNTED, no_shows_of
from skyway_composition.statistics import store
from skyway_composition.statistics.store import Selection
from skyway_composition.statistics.use import (
    DroneStatistics,
    DroneUse,
    FleetTotals,
    PadStatistics,
    PadTotals,
    PadUse,
    PadUseQuery,
    UseQuery,
    drone_totals,
    pad_totals,
)


def statistics_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """GET /v1/stats/pads and /v1/stats/drones."""
    router = ServiceRouter(tags=("statistics",))

    @router.get("/v1/stats/pads")
    async def get_pad_statistics(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[PadUseQuery, Query()]
    ) -> PadStatistics:
        """How the pads of each station were used in a span; a provider sees its own drones' use."""
        selection = _selection(caller, query, clock)
        async with db.survey() as connection:
            total = await store.pad_sums(connection, selection, query.network_id)
            rows = await store.pads_page(
                connection,
                selection,
                query.network_id,
                after=query.after_id(),
                limit=query.limit + 1,
            )
        elapsed_s = _elapsed_s(selection.span, clock)
        page = page_of(
            rows,
            query,
            item=lambda row: PadUse(
                station_id=row.station_id,
                network_id=row.network_id,
                **pad_totals(row, elapsed_s=elapsed_s),
            ),
            sort_key=lambda row: (row.station_id,),
        )
        return PadStatistics(
            **dict(page),
            from_at=selection.span.from_at,
            to_at=selection.span.to_at,
            provider_id=selection.provider_id,
            total=PadTotals(**pad_totals(total, elapsed_s=elapsed_s)),
        )

    @router.get("/v1/stats/drones")
    async def get_drone_statistics(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[UseQuery, Query()]
    ) -> DroneStatistics:
        """How each drone was used in a span; drones that did not fly are not listed."""
        selection = _selection(caller, query, clock)
        async with db.survey() as connection:
            total = await store.drone_sums(connection, selection)
            rows = await store.drones_page(
                connection,
                selection,
                after=query.after_id(),
                limit=query.limit + 1,
            )
        elapsed_s = _elapsed_s(selection.span, clock)
        page = page_of(
            rows,
            query,
            item=lambda row: DroneUse(
                drone_id=row.drone_id,
                provider_id=row.provider_id,
                **drone_totals(row, drones=1, elapsed_s=elapsed_s),
            ),
            sort_key=lambda row: (row.drone_id,),
        )
        return DroneStatistics(
            **dict(page),
            from_at=selection.span.from_at,
            to_at=selection.span.to_at,
            provider_id=selection.provider_id,
            total=FleetTotals(
                drones=total.drones,
                **drone_totals(total, drones=total.drones, elapsed_s=elapsed_s),
            ),
        )

    return router


def _selection(caller: Caller, query: UseQuery, clock: FleetClock) -> Selection:
    """The steps to count: a provider's own, or for an operator those of the requested provider."""
    caller.must_be("provider", "operator")
    if caller.role == "operator":
        return Selection(query.span(clock.now()), query.provider_id)
    if query.provider_id not in (None, caller.subject_id):
        raise NotFound("provider", str(query.provider_id))
    return Selection(query.span(clock.now()), ProviderId(caller.subject_id))


def _elapsed_s(span: Span, clock: FleetClock) -> float:
    """The part of the span that is over, seconds; the future has no use yet."""
    return max(0, min(span.end_ms, moment_to_ms(clock.now())) - span.start_ms) / 1000


class MissionStatistics(JsonModel):
    """Missions that are not over, unsent messages, absent drones, and what the dispatcher saves."""

    at: Annotated[FleetMoment, Field(description="The moment of this answer, fleet time.")]
    by_state: Annotated[
        dict[str, int],
        Field(
            description="Number of missions that are not over, by state.",
            examples=[{"ACTIVE": 3, "BOOKED": 1}],
        ),
    ]
    unsent: Annotated[
        dict[str, int],
        Field(
            description="Number of messages in the outbox, by channel; empty for providers.",
            examples=[{"mqtt": 2}],
        ),
    ]
    no_shows: Annotated[
        dict[str, int],
        Field(
            description="Number of missions of the last 7 days, fleet time, whose drones did not "
            "come, by provider. Providers without any are left out.",
            examples=[{"prv_01kq3w8x5v9m2n4p6r7s8t9v0w": 2}],
        ),
    ]
    better_orders: Annotated[
        dict[str, int],
        Field(
            description="How often the dispatcher has adopted a better order of waiting missions "
            "in the last 7 days, fleet time, by provider.",
            examples=[{"prv_01kq3w8x5v9m2n4p6r7s8t9v0w": 12}],
        ),
    ]
    saved_minutes: Annotated[
        dict[str, int],
        Field(
            description="Minutes by which these orders deliver earlier, all deliveries together, "
            "by provider.",
            examples=[{"prv_01kq3w8x5v9m2n4p6r7s8t9v0w": 95}],
        ),
    ]


def mission_statistics_routes(
    *, db: Database, gate: ServiceGate, clock: FleetClock
) -> ServiceRouter:
    """GET /v1/stats/missions."""
    router = ServiceRouter(tags=("statistics",))

    @router.get("/v1/stats/missions")
    async def get_mission_statistics(caller: Annotated[Caller, Depends(gate)]) -> MissionStatistics:
        """Count missions that are not over, unsent messages, absent drones, and better orders."""
        caller.must_be("provider", "operator")
        whose = ProviderId(caller.subject_id) if caller.role == "provider" else None
        async with db.read() as connection:
            by_state = await store.live_missions(connection, whose)
            unsent = await store.unsent(connection) if whose is None else {}
            since_ms = moment_to_ms(clock.now() - COUNTED)
            absent = await no_shows_of(connection, since_ms=since_ms, provider_id=whose)
            better = await store.better_orders_of(connection, whose, since_ms=since_ms)
        return MissionStatistics(
            at=clock.now(),
            by_state=dict(by_state),
            unsent=dict(unsent),
            no_shows=dict(absent),
            better_orders={provider_id: count for provider_id, (count, _) in better.items()},
            saved_minutes={
                provider_id: round(saved_ms / 60_000)
                for provider_id, (_, saved_ms) in better.items()
            },
        )

    return router
