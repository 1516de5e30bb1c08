"""Where a delivery's drones have been, are and will be, as GeoJSON (RFC 7946)."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.message import utc_text
from skyway.contracts.track import Track, TrackedMission, TrackedStep
from skyway.geo import Position
from skyway.ids import StationId
from skyway.json_model import JsonModel
from skyway_gateway.deliveries.lifecycle.delivery import Delivery


class PointGeometry(JsonModel):
    """A GeoJSON point."""

    type: Annotated[Literal["Point"], Field(description="The GeoJSON type.")] = "Point"
    coordinates: Annotated[Position, Field(description="Longitude and latitude, degrees.")]


class LineGeometry(JsonModel):
    """A GeoJSON line of at least two positions."""

    type: Annotated[Literal["LineString"], Field(description="The GeoJSON type.")] = "LineString"
    coordinates: Annotated[
        tuple[Position, ...],
        Field(min_length=2, description="Positions in order: longitude and latitude, degrees."),
    ]


class Feature(JsonModel):
    """A point or a line; `properties.kind` is FLOWN, PLANNED, DRONE or STATION."""

    type: Annotated[Literal["Feature"], Field(description="The GeoJSON type.")] = "Feature"
    geometry: Annotated[
        PointGeometry | LineGeometry, Field(discriminator="type", description="A point or a line.")
    ]
    properties: Annotated[
        dict[str, Any],
        Field(description="`kind`: FLOWN, PLANNED, DRONE or STATION; it decides the others."),
    ]  # JSON, other members for each kind


class FeatureCollection(JsonModel):
    """The answer of /v1/deliveries/{delivery_id}/track."""

    type: Annotated[Literal["FeatureCollection"], Field(description="The GeoJSON type.")] = (
        "FeatureCollection"
    )
    features: Annotated[
        tuple[Feature, ...],
        Field(description="The lines and drone of each mission, then the stations."),
    ]


def feature_collection(delivery: Delivery, track: Track) -> FeatureCollection:
    """Each mission's lines and drone, and each station of its steps once."""
    features = [feature for mission in track.missions for feature in _of_mission(mission)]
    return FeatureCollection(features=(*features, *_stations(delivery, track)))


def _of_mission(mission: TrackedMission) -> Iterator[Feature]:
    about = {
        "mission_id": mission.mission_id,
        "provider_id": mission.provider_id,
        "drone_id": mission.drone_id,
    }
    flights = [step for step in mission.steps if step.kind == "FLY"]
    flown = [step for step in flights if step.status == "ENDED"]
    under_way = [step for step in flights if step.status == "UNDER_WAY"]
    ahead = [step for step in flights if step.status == "PLANNED"]
    here = [] if mission.position is None else [mission.position]

    began = [step.from_position for step in under_way]
    yield from _way("FLOWN", [*_places(flown), *began, *(here if under_way else [])], about)
    goes_on = [step.to_position for step in under_way]
    ahead_places = [*(here if under_way else []), *goes_on, *_places(ahead)]
    yield from _way("PLANNED", ahead_places, {**about, **_times(under_way + ahead)})
    if mission.position is not None:
        at = mission.position_at and utc_text(mission.position_at)
        properties = {"kind": "DRONE", **about, "soc": mission.soc, "at": at}
        yield Feature(geometry=PointGeometry(coordinates=mission.position), properties=properties)


def _places(flights: Sequence[TrackedStep]) -> list[Position]:
    """The positions along consecutive flights."""
    return [place for step in flights for place in (step.from_position, step.to_position)]


def _way(kind: str, places: Sequence[Position], about: dict[str, Any]) -> Iterator[Feature]:
    """A line as one feature; no feature where the drone does not move."""
    distinct = [*places[:1], *(after for before, after in pairwise(places) if after != before)]
    if len(distinct) > 1:
        geometry = LineGeometry(coordinates=tuple(distinct))
        yield Feature(geometry=geometry, properties={"kind": kind, **about})


def _times(steps: Sequence[TrackedStep]) -> dict[str, Any]:
    if not steps:
        return {}
    return {"start_at": utc_text(steps[0].start_at), "end_at": utc_text(steps[-1].end_at)}


def _stations(delivery: Delivery, track: Track) -> Iterator[Feature]:
    """The stations of the missions' steps, with what happens there."""
    steps: dict[StationId, list[TrackedStep]] = {}
    for mission in track.missions:
        for step in mission.steps:
            steps.setdefault(step.station_id, []).append(step)
    for station_id, stops in steps.items():
        properties = {
            "kind": "STATION",
            "station_id": station_id,
            "is_pickup": station_id == delivery.pickup.station_id,
            "stops": [_stop(step) for step in stops if step.kind != "FLY"],
        }
        place = PointGeometry(coordinates=stops[0].to_position)
        yield Feature(geometry=place, properties=properties)


def _stop(step: TrackedStep) -> dict[str, Any]:
    return {
        "kind": step.kind,
        "status": step.status,
        "start_at": utc_text(step.start_at),
        "end_at": utc_text(step.end_at),
        "package_ids": list(step.package_ids),
    }
