"""How much of a span pads were charging and drones were busy."""

from typing import Annotated, Any

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.contracts.statistics import SpanQuery
from skyway.ids import DroneId, NetworkId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.http.paging import Page, PageQuery

#: 0 to 1; null when the whole is zero.
Share = float | None


class UseQuery(SpanQuery, PageQuery):
    """Which drones' use is counted."""


class PadUseQuery(UseQuery):
    """Which pads' use is counted."""

    network_id: Annotated[
        NetworkId | None, Field(description="Only stations of this network; without it all.")
    ] = None


class PadTotals(JsonModel):
    """How pads were used in the span; only steps that have ended count."""

    pads: Annotated[int, Field(description="Number of pads.")]
    sessions: Annotated[int, Field(description="Number of recharging sessions.")]
    charging_s: Annotated[float, Field(description="Time that drones charged, seconds.")]
    waiting_s: Annotated[
        float, Field(description="Time that drones waited without a pad, seconds.")
    ]
    utilisation: Annotated[
        Share,
        Field(description="Share of all pads' time that drones charged, 0 to 1; null without any."),
    ]


class PadUse(PadTotals):
    """How the pads of one station were used in the span."""

    station_id: Annotated[StationId, Field(description="Id of the station.")]
    network_id: Annotated[NetworkId, Field(description="Network of the station.")]


class DroneTotals(JsonModel):
    """How drones were used in the span; only steps that have ended count."""

    missions: Annotated[int, Field(description="Number of missions.")]
    busy_s: Annotated[
        float,
        Field(description="Time from the first to the last step of each mission, seconds."),
    ]
    flying_s: Annotated[float, Field(description="Time in flight, seconds.")]
    recharging_s: Annotated[float, Field(description="Time on pads, recharging, seconds.")]
    loading_s: Annotated[float, Field(description="Time to load at pickups, seconds.")]
    delivering_s: Annotated[
        float, Field(description="Time to hand over or return packages, seconds.")
    ]
    waiting_s: Annotated[float, Field(description="All other time of missions, seconds.")]
    approach_s: Annotated[
        float,
        Field(description="Time before a mission's first pickup, without recharging, seconds."),
    ]
    service_s: Annotated[
        float,
        Field(
            description="Time from a mission's first pickup to its last hand-over, without "
            "recharging, seconds. All time of missions that is in no other use counts here."
        ),
    ]
    standby_s: Annotated[
        float,
        Field(description="Time after a mission's last hand-over, without recharging, seconds."),
    ]
    idle_s: Annotated[
        float,
        Field(
            description="Time without a mission in the part of the span that is over, seconds. "
            "approach_s, service_s, standby_s, recharging_s and idle_s add up to this part for "
            "each drone."
        ),
    ]
    utilisation: Annotated[
        Share,
        Field(description="Share of the drones' time that they were busy, 0 to 1; null if none."),
    ]


class FleetTotals(DroneTotals):
    """How all drones that flew in the span were used."""

    drones: Annotated[int, Field(description="Number of drones that flew in the span.")]


class DroneUse(DroneTotals):
    """How one drone was used in the span."""

    drone_id: Annotated[DroneId, Field(description="Id of the drone.")]
    provider_id: Annotated[ProviderId, Field(description="Provider of the drone.")]


class _Spanned(JsonModel):
    from_at: Annotated[FleetMoment, Field(alias="from", description="Start of the span.")]
    to_at: Annotated[FleetMoment, Field(alias="to", description="End of the span.")]
    provider_id: Annotated[
        ProviderId | None, Field(description="Provider whose drones count; null means all.")
    ]


class PadStatistics(Page[PadUse], _Spanned):
    """The pads of each station, in order of station ids, and the sum of all stations."""

    total: Annotated[PadTotals, Field(description="Sum of all stations, not only this page.")]


class DroneStatistics(Page[DroneUse], _Spanned):
    """Each drone that flew in the span, in order of drone ids, and the sum of all drones."""

    total: Annotated[FleetTotals, Field(description="Sum of all drones, not only this page.")]


def pad_totals(row: Any, *, elapsed_s: float) -> dict[str, Any]:  # a row, and members of any type
    """The members of `PadTotals`, from sums in milliseconds; a null sum counts as 0."""
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
    """The members of `DroneTotals`, from sums in milliseconds; a null sum counts as 0."""
    names = ("busy", "flying", "recharging", "loading", "delivering")
    spent_s = {f"{name}_s": float((getattr(row, f"{name}_ms") or 0) / 1000) for name in names}
    busy_s = spent_s.pop("busy_s")
    approach_s, standby_s = (
        float((each or 0) / 1000) for each in (row.approach_ms, row.standby_ms)
    )
    return {
        "missions": int(row.missions or 0),
        "busy_s": busy_s,
        **spent_s,
        "waiting_s": max(0.0, busy_s - sum(spent_s.values())),
        "approach_s": approach_s,
        "service_s": max(0.0, busy_s - approach_s - standby_s - spent_s["recharging_s"]),
        "standby_s": standby_s,
        "idle_s": max(0.0, drones * elapsed_s - busy_s),
        "utilisation": _share(busy_s, drones * elapsed_s),
    }


def _share(part_s: float, whole_s: float) -> float | None:
    return part_s / whole_s if whole_s > 0 else None
