"""How much of a span pads were taken and drones were busy."""

from typing import Annotated, Any

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.contracts.statistics import SpanQuery
from skyway.ids import DroneId, NetworkId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.http.paging import Page, PageQuery

Share = Annotated[float | None, Field(description="0 to 1; null when there is nothing to share")]


class UseQuery(SpanQuery, PageQuery):
    """The query of drones' use."""


class PadUseQuery(UseQuery):
    """The query of pads' use."""

    network_id: NetworkId | None = None


class PadTotals(JsonModel):
    """What pads were used for; what is under way counts once it has ended.

    `utilisation` is the share of all pads' time that was charged; `waiting_s` is how long drones
    stood waiting, on no pad.
    """

    pads: int
    sessions: int
    charging_s: float
    waiting_s: float
    utilisation: Share


class PadUse(PadTotals):
    """The same of one station."""

    station_id: StationId
    network_id: NetworkId


class DroneTotals(JsonModel):
    """What drones spent time on; what is under way counts once it has ended.

    `busy_s` is from the first step of each mission to its last; `utilisation` is its share of all
    these drones' time. Time between two steps is waiting.
    """

    missions: int
    busy_s: float
    flying_s: float
    recharging_s: float
    loading_s: float
    delivering_s: float
    waiting_s: float
    utilisation: Share


class FleetTotals(DroneTotals):
    """The same of all drones that flew in the span."""

    drones: int


class DroneUse(DroneTotals):
    """The same of one drone."""

    drone_id: DroneId
    provider_id: ProviderId


class _Spanned(JsonModel):
    from_at: Annotated[FleetMoment, Field(alias="from")]
    to_at: Annotated[FleetMoment, Field(alias="to")]
    provider_id: ProviderId | None


class PadStatistics(Page[PadUse], _Spanned):
    """Each station's pads, by station id, and all of them together."""

    total: PadTotals


class DroneStatistics(Page[DroneUse], _Spanned):
    """Each drone that flew in the span, by drone id, and all of them together."""

    total: FleetTotals


def pad_totals(row: Any, *, elapsed_s: float) -> dict[str, Any]:  # a row, and members of any type
    """The members of `PadTotals`, of sums in milliseconds that are null where nothing was."""
    pads, charging_s = int(row.pads or 0), (row.charging_ms or 0) / 1000
    return {
        "pads": pads,
        "sessions": int(row.sessions or 0),
        "charging_s": float(charging_s),
        "waiting_s": float((row.waiting_ms or 0) / 1000),
        "utilisation": _share(float(charging_s), pads * elapsed_s),
    }


def drone_totals(
    row: Any, *, drones: int, elapsed_s: float
) -> dict[str, Any]:  # a row, and members of any type
    """The members of `DroneTotals`, of sums in milliseconds that are null where nothing was."""
    names = ("busy", "flying", "recharging", "loading", "delivering")
    spent_s = {f"{name}_s": float((getattr(row, f"{name}_ms") or 0) / 1000) for name in names}
    busy_s = spent_s.pop("busy_s")
    return {
        "missions": int(row.missions or 0),
        "busy_s": busy_s,
        **spent_s,
        "waiting_s": max(0.0, busy_s - sum(spent_s.values())),
        "utilisation": _share(busy_s, drones * elapsed_s),
    }


def _share(part_s: float, whole_s: float) -> float | None:
    return part_s / whole_s if whole_s > 0 else None
