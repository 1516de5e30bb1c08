"""Makes the folder of a console's base map from a GeoJSON or a PMTiles file.

The folder has a MapLibre style for light and one for dark screens, the data, and the names of
places, which the console draws itself: maps without a network have no fonts.
"""

import gzip
import json
import math
import shutil
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from skyway.errors import InvalidInput

#: The largest GeoJSON file that is read: a console loads what is left of it as a whole.
MOST_GEOJSON_BYTES: Final = 200 * 1024 * 1024

#: The largest description of a PMTiles file that is read, unpacked.
MOST_METADATA_BYTES: Final = 4 * 1024 * 1024

#: How large the simplified data may be, compressed as a browser receives it.
MOST_DATA_BYTES: Final = 4 * 1024 * 1024

#: Metres in a degree of latitude.
_DEGREE_M: Final = 111_195.0
_DIGITS: Final = 5

#: Words in the names of layers, and values of a feature's properties, by what they are drawn as.
_KINDS: Final[Mapping[str, tuple[str, ...]]] = {
    "water": ("water", "ocean", "sea", "lake", "bay", "reservoir"),
    "river": ("waterway", "river", "stream", "canal"),
    "road": ("road", "transportation", "highway", "street", "railway"),
    "border": ("boundary", "boundaries", "border", "admin"),
    "urban": ("urban", "residential", "building", "landuse", "city"),
    "place": ("place", "settlement"),
    "land": ("land", "earth"),
}
_ORDER: Final = ("land", "urban", "water", "river", "road", "border")

#: The colours of the console's own base map (map/colours.js) by kind: light, dark.
_COLOURS: Final[Mapping[str, tuple[str, str]]] = {
    "background": ("#f5f4ef", "#19232d"),
    "land": ("#f5f4ef", "#19232d"),
    "urban": ("#e6dfcf", "#2e3a47"),
    "water": ("#c3dbe9", "#0a141d"),
    "river": ("#a5c8de", "#24506f"),
    "road": ("#dcd7cb", "#33404d"),
    "border": ("#9d9c96", "#55616d"),
}
_WIDTHS: Final = {"river": 1.5, "road": 1.2, "border": 1.0}

_PMTILES_HEADER_BYTES: Final = 127
_VECTOR_TILES: Final = 1
_RASTER_TILES: Final = (2, 3, 4, 5)
_PLAIN, _GZIP = 1, 2


def make_base_map(
    source: Path, folder: Path, *, layer_property: str, tolerance_m: float
) -> list[str]:
    """Fill the folder, and name what the map shows.

    Raises
    ------
    InvalidInput
        The file is neither GeoJSON nor PMTiles, or too large, or has nothing to draw.
    """
    if source.resolve().is_relative_to(folder.resolve()):
        raise InvalidInput("FILE", f"{source} lies in the folder that is made")
    with source.open("rb") as content:
        is_archive = content.read(7) == b"PMTiles"
    if is_archive:
        return _from_archive(source, folder)
    return _from_geojson(source, folder, layer_property=layer_property, tolerance_m=tolerance_m)


def _from_geojson(
    source: Path, folder: Path, *, layer_property: str, tolerance_m: float
) -> list[str]:
    features = list(_features(source))
    shapes: list[dict[str, Any]] = []
    places: list[list[Any]] = []
    for number, feature in enumerate(features):
        geometry = feature.get("geometry") or {}
        properties = feature.get("properties") or {}
        kind = _kind_of(properties, layer_property, geometry.get("type"))
        try:
            if kind == "place":
                places += _place(properties, geometry)
            elif kind is not None:
                shapes.append(_shape(kind, geometry, tolerance_m))
        except (TypeError, ValueError, KeyError, IndexError) as error:
            raise InvalidInput(f"features.{number}", "its coordinates are not GeoJSON's") from error
    kinds = {shape["properties"]["kind"] for shape in shapes}
    if not kinds:
        raise InvalidInput("FILE", "it has no line and no area to draw")
    document = json.dumps({"type": "FeatureCollection", "features": shapes}, separators=(",", ":"))
    size = len(gzip.compress(document.encode(), compresslevel=6))
    if size > MOST_DATA_BYTES:
        raise InvalidInput(
            "--tolerance-m",
            f"{size} bytes are left, more than {MOST_DATA_BYTES}: simplify more, or make PMTiles",
        )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "map.json").write_text(document)
    _write_styles(
        folder,
        {"type": "geojson", "data": "map.json"},
        [(kind, {}, ["==", ["get", "kind"], kind]) for kind in _ORDER if kind in kinds],
        places=sorted(places, key=lambda row: -row[3]),
    )
    return [kind for kind in _ORDER if kind in kinds] + (["place"] if places else [])


def _features(source: Path) -> Iterator[Mapping[str, Any]]:
    size = source.stat().st_size
    if size > MOST_GEOJSON_BYTES:
        raise InvalidInput(
            "FILE", f"{size} bytes are more than {MOST_GEOJSON_BYTES}: make PMTiles of it"
        )
    try:
        document = json.loads(source.read_bytes())
    except (ValueError, RecursionError) as error:
        raise InvalidInput("FILE", f"{source.name} is neither GeoJSON nor PMTiles") from error
    found = document.get("features") if isinstance(document, dict) else None
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise InvalidInput("FILE", f"{source.name} is not a FeatureCollection of GeoJSON")
    yield from found


def _kind_of(properties: Mapping[str, Any], layer_property: str, shape: str | None) -> str | None:
    """What a feature is drawn as: by its layer, by the tags of OpenStreetMap, or by its shape."""
    named = properties.get(layer_property)
    kind = kind_named(str(named)) if named is not None else None
    if kind is None:
        tags = ("waterway", "highway", "railway", "boundary", "place", "landuse")
        tagged = (tag for tag in tags if properties.get(tag))
        kind = next((kind_named(tag) for tag in tagged), None)
        kind = kind or kind_named(str(properties.get("natural", "")))
    if shape in ("Point", "MultiPoint"):
        return "place" if kind == "place" else None
    if kind is not None and kind != "place":
        return kind
    return {"Polygon": "land", "LineString": "border"}.get(str(shape).removeprefix("Multi"))


def kind_named(name: str) -> str | None:
    """What a layer of this name is drawn as; None if the name says nothing."""
    words = name.lower()
    return next(
        (
            kind
            for kind in ("river", "water", "road", "border", "urban", "place", "land")
            if any(word in words for word in _KINDS[kind])
        ),
        None,
    )


def _place(properties: Mapping[str, Any], geometry: Mapping[str, Any]) -> list[list[Any]]:
    name = properties.get("name")
    if geometry["type"] != "Point" or not name:
        return []
    longitude, latitude = geometry["coordinates"][:2]
    people = str(properties.get("population", ""))
    return [[str(name), float(longitude), float(latitude), int(people) if people.isdigit() else 0]]


def _shape(kind: str, geometry: Mapping[str, Any], tolerance_m: float) -> dict[str, Any]:
    coordinates = _simplified(geometry["coordinates"], tolerance_m)
    return {
        "type": "Feature",
        "properties": {"kind": kind},
        "geometry": {"type": geometry["type"], "coordinates": coordinates},
    }


def _simplified(coordinates: Any, tolerance_m: float) -> list[Any]:  # nested lists of numbers
    """Each line with fewer points, none further from the old line than the tolerance."""
    if not isinstance(coordinates[0][0], int | float):
        return [_simplified(each, tolerance_m) for each in coordinates]
    points = [(float(point[0]), float(point[1])) for point in coordinates]
    if not all(math.isfinite(x) and abs(y) <= 90 for x, y in points):
        raise ValueError("a coordinate is no degree")
    kept = sorted(_kept(points, tolerance_m))
    # A ring keeps four points at least, or it is no ring.
    if points[0] == points[-1] and len(kept) < 4:
        kept = sorted({*kept, len(points) // 3, 2 * len(points) // 3})
    return [[round(points[at][0], _DIGITS), round(points[at][1], _DIGITS)] for at in kept]


def _kept(points: list[tuple[float, float]], tolerance_m: float) -> set[int]:
    """The numbers of the points that stay (Douglas and Peucker 1973), without recursion."""
    last = len(points) - 1
    kept = {0, last}
    spans = [(0, last)]
    while spans:
        begin, end = spans.pop()
        if end - begin < 2:
            continue
        far, at = max(
            (_distance_m(points[number], points[begin], points[end]), number)
            for number in range(begin + 1, end)
        )
        if far > tolerance_m:
            kept.add(at)
            spans += [(begin, at), (at, end)]
    return kept


def _distance_m(
    point: tuple[float, float], begin: tuple[float, float], end: tuple[float, float]
) -> float:
    """How far a point lies from a line, on a plane that touches the earth there."""
    narrowing = math.cos(math.radians(point[1]))
    x, y = (point[0] - begin[0]) * narrowing, point[1] - begin[1]
    right, up = (end[0] - begin[0]) * narrowing, end[1] - begin[1]
    length = right * right + up * up
    share = 0.0 if length == 0 else min(1.0, max(0.0, (x * right + y * up) / length))
    return math.hypot(x - share * right, y - share * up) * _DEGREE_M


def _from_archive(source: Path, folder: Path) -> list[str]:
    with source.open("rb") as content:
        header = content.read(_PMTILES_HEADER_BYTES)
        if len(header) < _PMTILES_HEADER_BYTES or header[7] != 3:
            raise InvalidInput("FILE", f"{source.name} is not PMTiles of version 3")
        at, length = (int.from_bytes(header[n : n + 8], "little") for n in (24, 32))
        if length > MOST_METADATA_BYTES:
            raise InvalidInput("FILE", f"its description of {length} bytes is too long")
        content.seek(at)
        metadata = _metadata(content.read(length), header[97])
    tiles: dict[str, Any] = {"url": f"pmtiles://{source.name}"}
    if header[99] in _RASTER_TILES:
        tiles |= {"type": "raster", "tileSize": 256}
        layers: list[tuple[str, dict[str, Any], Any]] = [("raster", {}, None)]
    elif header[99] == _VECTOR_TILES:
        tiles |= {"type": "vector"}
        named = [str(each.get("id", "")) for each in metadata.get("vector_layers", [])]
        kinds = sorted(((kind_named(name), name) for name in named), key=_drawn_at)
        layers = [(kind, {"source-layer": name}, None) for kind, name in kinds if kind in _ORDER]
        if not layers:
            raise InvalidInput("FILE", f"no layer of it is known: {', '.join(named) or 'none'}")
    else:
        raise InvalidInput("FILE", f"tiles of type {header[99]} cannot be drawn")
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, folder / source.name)
    _write_styles(folder, tiles, layers, places=[])
    return [more.get("source-layer", kind) for kind, more, _ in layers]


def _drawn_at(layer: tuple[str | None, str]) -> int:
    return _ORDER.index(layer[0]) if layer[0] in _ORDER else len(_ORDER)


def _metadata(packed: bytes, compression: int) -> Mapping[str, Any]:
    """The description inside a PMTiles file; a small file cannot unpack to a huge one."""
    try:
        if compression == _GZIP:
            unpacked = zlib.decompressobj(31).decompress(packed, MOST_METADATA_BYTES)
        elif compression == _PLAIN:
            unpacked = packed
        else:
            raise InvalidInput("FILE", f"its compression {compression} is not gzip")
        document = json.loads(unpacked)
    except (zlib.error, ValueError, RecursionError) as error:
        raise InvalidInput("FILE", "its description cannot be read") from error
    if not isinstance(document, dict):
        raise InvalidInput("FILE", "its description is no JSON object")
    return document


def _write_styles(
    folder: Path,
    source: Mapping[str, Any],
    layers: Iterable[tuple[str, Mapping[str, Any], Any]],
    *,
    places: list[list[Any]],
) -> None:
    layers = list(layers)
    for name, theme in (("style.json", 0), ("style-dark.json", 1)):
        style = {
            "version": 8,
            "metadata": {"skyway:dark": "style-dark.json", "skyway:places": "places.json"},
            "sources": {"map": source},
            "layers": [
                {
                    "id": "background",
                    "type": "background",
                    "paint": {"background-color": _COLOURS["background"][theme]},
                },
                *(each for layer in layers for each in _styled(*layer, theme=theme)),
            ],
        }
        (folder / name).write_text(json.dumps(style, indent=1) + "\n")
    (folder / "places.json").write_text(json.dumps(places, ensure_ascii=False) + "\n")


def _styled(
    kind: str, more: Mapping[str, Any], only: Any, *, theme: int
) -> Iterator[dict[str, Any]]:
    """The layers of a kind: its areas, and its lines."""
    name = str(more.get("source-layer", kind))
    if kind == "raster":
        yield {"id": name, "type": "raster", "source": "map"}
        return
    colour = _COLOURS[kind][theme]
    whole = {"source": "map", **more}
    shapes = [["==", ["geometry-type"], "Polygon"], ["==", ["geometry-type"], "LineString"]]
    area, line = (["all", only, shape] if only else shape for shape in shapes)
    if kind not in ("road", "border"):
        yield {
            **whole,
            "id": f"{name}-areas",
            "type": "fill",
            "filter": area,
            "paint": {"fill-color": colour},
        }
    width = _WIDTHS.get(kind, 1.0)
    yield {
        **whole,
        "id": f"{name}-lines",
        "type": "line",
        "filter": line,
        "paint": {"line-color": colour, "line-width": width},
    }
