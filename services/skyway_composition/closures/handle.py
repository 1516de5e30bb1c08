"""Handle requests about closures of every kind: make, preview, list and lift."""

from typing import Any, Final

from skyway.ids import ClosureId, NetworkId, StationId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, page_of
from skyway_composition.closures import store
from skyway_composition.closures.close import Closings
from skyway_composition.closures.closure import Closure, ClosureKind
from skyway_composition.closures.orders import (
    ClosureInfo,
    ClosureMade,
    ClosureOrder,
    ClosureQuery,
    DryRun,
    made,
    shown,
)
from skyway_composition.closures.store import ClosureFilter

#: A closure has no id before it is made.
_NOT_MADE: Final = ClosureId("")

#: The answer to a POST that made a closure; a dry run is answered with 200.
MADE: Final[dict[int | str, dict[str, Any]]] = {201: {"model": ClosureMade}}


def closure_of(
    kind: ClosureKind,
    network_id: NetworkId | None,
    closings: Closings,
    order: ClosureOrder | None,
    **members: Any,  # the members of Closure that this kind has
) -> Closure:
    """The closure that an order asks for; it is not made yet."""
    order = order or ClosureOrder()
    from_ms, until_ms = order.span_ms(closings.now_ms)
    return Closure(
        closure_id=_NOT_MADE,
        kind=kind,
        network_id=network_id,
        from_ms=from_ms,
        made_ms=closings.now_ms,
        until_ms=until_ms,
        reason=order.reason,
        **members,
    )


def status_of(query: DryRun) -> int:
    """The HTTP status: 201 when a closure is made, 200 for a dry run."""
    return 200 if query.dry_run else 201


async def make_or_preview(closings: Closings, closure: Closure, query: DryRun) -> ClosureMade:
    """Make the closure, or preview it for a dry run; the answer names the affected missions."""
    if query.dry_run:
        affected = await closings.preview(closure)
    else:
        closure, affected = await closings.make(closure)
    return made(closure, affected)


async def page_of_kind(
    closings: Closings,
    caller: Caller,
    query: ClosureQuery,
    kind: ClosureKind,
    *,
    station_id: StationId | None = None,
    pad: int | None = None,
    to_station_id: StationId | None = None,
) -> Page[ClosureInfo]:
    """The closures of this kind and place, in order of their ids."""
    caller.must_be("customer", "provider", "operator", "service")
    if station_id is not None:
        await closings.around(station_id)
    after = query.after(str)
    shown_ones = ClosureFilter(
        kind=kind,
        lasting_beyond_ms=None if query.all else closings.now_ms,
        station_id=station_id,
        pad=pad,
        to_station_id=to_station_id,
    )
    async with closings.db.read() as connection:
        rows = await store.page(
            connection, shown_ones, after=str(after[0]) if after else "", limit=query.limit + 1
        )
    return page_of(rows, query, item=shown, sort_key=lambda row: (row.closure_id,))


async def lift(
    closings: Closings,
    caller: Caller,
    closure_id: ClosureId,
    kind: ClosureKind,
    *,
    station_id: StationId | None = None,
    pad: int | None = None,
    to_station_id: StationId | None = None,
) -> None:
    """Lift a closure of this kind and place.

    Raises
    ------
    NotFound
        There is no such closure, or it has another kind or place.
    """
    caller.must_be("operator")
    async with closings.db.read() as connection:
        closure = await store.get(connection, closure_id)
    asked = (kind, station_id, pad, to_station_id)
    if closure is None or asked != (
        closure.kind,
        closure.station_id,
        closure.pad,
        closure.to_station_id,
    ):
        raise NotFound("closure", closure_id)
    await closings.lift(closure)
