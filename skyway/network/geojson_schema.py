"""The GeoJSON of a network as models: what the API's document shows, and what `read_network` reads.

A network may hold a million features, so `read_network` reads the JSON by columns, not by these.
"""

from datetime import date
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from skyway.bounds import Moment
from skyway.geo import Position
from skyway.ids import ConnectorId, StationId, ZoneId
from skyway.network.geojson_features import MAX_SEGMENT_LENGTH_M
from skyway.network.network import DEFAULT_PADS, MAX_PADS
from skyway.network.pad_connectors import MOST_OF_PAD
from skyway.network.pad_power import MAX_POWER_W, MIN_POWER_W

Weekday = Literal["mon", "tue", "wed", "thu", "fri", "sat", "sun"]


class _Open(BaseModel):
    """GeoJSON may hold further members; Skyway keeps those of `properties`."""

    model_config = ConfigDict(extra="allow")


class StationPoint(_Open):
    """Where a station is."""

    type: Annotated[Literal["Point"], Field(description="Always Point.")]
    coordinates: Annotated[Position, Field(description="Longitude and latitude in degrees.")]


class StationHours(BaseModel):
    """When a station is open for landings, loading and hand-overs."""

    model_config = ConfigDict(extra="forbid")

    time_zone: Annotated[
        str, Field(description="The IANA name of the zone of all hours.", examples=["US/Central"])
    ] = "UTC"
    weekly: Annotated[
        dict[Weekday, tuple[str, ...]],
        Field(
            description="The spans of each weekday, such as 08:00-17:30; a missing day is closed.",
            examples=[{"mon": ["08:00-12:00", "13:00-17:30"]}],
        ),
    ]
    exceptions: Annotated[
        dict[date, tuple[str, ...]],
        Field(
            description="Dates with other spans than their weekday; an empty list is closed.",
            examples=[{"2026-12-25": []}],
        ),
    ] = {}


class StationProperties(_Open):
    """What a station is called, and how many drones it can recharge."""

    kind: Annotated[Literal["station"], Field(description="Always station.")]
    station_id: Annotated[StationId, Field(description="The station's id, unique everywhere.")]
    name: Annotated[str | None, Field(description="The station's name for people.")] = None
    pads: Annotated[
        int,
        Field(ge=0, le=MAX_PADS, description=f"How many recharging pads it has, 0 to {MAX_PADS}."),
    ] = DEFAULT_PADS
    parking: Annotated[
        bool,
        Field(description="Whether idle drones may gather here; then it needs at least one pad."),
    ] = False
    opening_hours: Annotated[
        StationHours | None, Field(description="When it is open; always if missing.")
    ] = None
    pad_power_w: Annotated[
        float | None,
        Field(
            ge=MIN_POWER_W,
            le=MAX_POWER_W,
            description="The most power that one pad gives in watts; no limit if missing.",
            examples=[500.0],
        ),
    ] = None
    station_power_w: Annotated[
        float | None,
        Field(
            ge=MIN_POWER_W,
            le=MAX_POWER_W,
            description="The most power of all pads together in watts. Plans count on an equal "
            "share for each pad. No limit if missing.",
            examples=[1500.0],
        ),
    ] = None

    pad_connectors: Annotated[
        tuple[ConnectorId, ...] | None,
        Field(
            min_length=1,
            max_length=MOST_OF_PAD,
            description="The connectors that each pad has. A drone whose model has another "
            "connector cannot charge here. If missing, the pads fit every drone.",
            examples=[["blade-6"]],
        ),
    ] = None


class StationFeature(_Open):
    """A station: a place where drones land and recharge."""

    type: Annotated[Literal["Feature"], Field(description="Always Feature.")]
    geometry: Annotated[StationPoint, Field(description="Where the station is.")]
    properties: Annotated[StationProperties, Field(description="What the station is.")]


class SegmentLine(_Open):
    """A straight line between two stations."""

    type: Annotated[Literal["LineString"], Field(description="Always LineString.")]
    coordinates: Annotated[
        tuple[Position, Position],
        Field(description="The places of both stations, in degrees, within 100 m of them."),
    ]


class SegmentProperties(_Open):
    """Which stations a segment joins, and how long it is."""

    kind: Annotated[Literal["segment"], Field(description="Always segment.")]
    from_id: Annotated[
        StationId, Field(alias="from", description="The station where the segment begins.")
    ]
    to_id: Annotated[
        StationId, Field(alias="to", description="The station where the segment ends.")
    ]
    length_m: Annotated[
        float | None,
        Field(
            ge=0,
            le=MAX_SEGMENT_LENGTH_M,
            description="Length in metres; the great-circle distance if it is missing.",
        ),
    ] = None
    one_way: Annotated[bool, Field(description="Whether drones fly it in this direction only.")] = (
        False
    )


class SegmentFeature(_Open):
    """A segment: a line of sight that drones fly between two stations."""

    type: Annotated[Literal["Feature"], Field(description="Always Feature.")]
    geometry: Annotated[SegmentLine, Field(description="The segment's line.")]
    properties: Annotated[SegmentProperties, Field(description="What the segment is.")]


class ZonePolygon(_Open):
    """The border of a zone."""

    type: Annotated[Literal["Polygon"], Field(description="Always Polygon.")]
    coordinates: Annotated[
        tuple[Annotated[tuple[Position, ...], Field(min_length=4)], ...],
        Field(min_length=1, description="Closed rings in degrees: the border, then its holes."),
    ]


class ZoneProperties(_Open):
    """What a zone is called, and when drones must stay out of it."""

    kind: Annotated[Literal["zone"], Field(description="Always zone.")]
    zone_id: Annotated[ZoneId, Field(description="The zone's id, unique in its network.")]
    active_from: Annotated[
        Moment | None, Field(description="When it begins, fleet time; always if missing.")
    ] = None
    active_until: Annotated[
        Moment | None, Field(description="When it ends, fleet time; never if missing.")
    ] = None


class ZoneFeature(_Open):
    """A zone: an area that drones neither cross nor land in while it is active."""

    type: Annotated[Literal["Feature"], Field(description="Always Feature.")]
    geometry: Annotated[ZonePolygon, Field(description="The zone's border.")]
    properties: Annotated[ZoneProperties, Field(description="What the zone is.")]


class NetworkGeoJson(_Open):
    """A skyway network as a GeoJSON FeatureCollection (RFC 7946)."""

    type: Annotated[Literal["FeatureCollection"], Field(description="Always FeatureCollection.")]
    features: Annotated[
        tuple[StationFeature | SegmentFeature | ZoneFeature, ...],
        Field(description="Stations, segments and zones, in any order."),
    ]
