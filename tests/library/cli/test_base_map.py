"""`skyway console base-map`: a user's own region as the folder of SKYWAY_CONSOLE_MAP."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

from skyway.cli.base_map import MOST_METADATA_BYTES, kind_named, make_base_map
from skyway.errors import InvalidInput
from tests.gateway.console.map_archive import LAND, write_archive


def make(source: Path, folder: Path, *, tolerance_m: float = 20.0) -> list[str]:
    return make_base_map(source, folder, layer_property="layer", tolerance_m=tolerance_m)


def feature(shape: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": shape, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def written(folder: Path, features: list[dict[str, Any]]) -> Path:
    file = folder / "region.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return file


def read(file: Path) -> Any:  # JSON
    return json.loads(file.read_text())


SQUARE = [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]]


def test_each_feature_is_drawn_by_its_layer_its_tags_or_its_shape(tmp_path: Path) -> None:
    source = written(
        tmp_path,
        [
            feature("Polygon", SQUARE, layer="Lakes"),
            feature("LineString", [[0, 0], [1, 1]], waterway="stream"),
            feature("Polygon", SQUARE),
            feature("Point", [8.5, 47.4], place="city", name="Zürich", population="430000"),
            feature("Point", [8.5, 47.4], shop="bakery", name="Brot"),
        ],
    )

    shown = make(source, tmp_path / "map")

    assert shown == ["land", "water", "river", "place"]
    kinds = [each["properties"]["kind"] for each in read(tmp_path / "map/map.json")["features"]]
    assert kinds == ["water", "river", "land"]
    assert read(tmp_path / "map/places.json") == [["Zürich", 8.5, 47.4, 430000]]
    light, dark = (read(tmp_path / "map" / f"style{theme}.json") for theme in ("", "-dark"))
    assert [each["id"] for each in light["layers"]] == [each["id"] for each in dark["layers"]]
    assert light["layers"] != dark["layers"]
    assert light["metadata"]["skyway:dark"] == "style-dark.json"


def test_lines_keep_only_the_points_that_matter(tmp_path: Path) -> None:
    nearly_straight = [[0.0, 0.0], [0.5, 0.00001], [1.0, 0.0], [1.0, 1.0]]
    source = written(tmp_path, [feature("LineString", nearly_straight, layer="road")])

    make(source, tmp_path / "map")

    kept = read(tmp_path / "map/map.json")["features"][0]["geometry"]["coordinates"]
    assert kept == [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]


def test_a_small_ring_stays_a_ring(tmp_path: Path) -> None:
    tiny = [[[x / 1e6, y / 1e6] for x, y in SQUARE[0]]]
    source = written(tmp_path, [feature("Polygon", tiny, layer="water")])

    make(source, tmp_path / "map", tolerance_m=1_000)

    (ring,) = read(tmp_path / "map/map.json")["features"][0]["geometry"]["coordinates"]
    assert len(ring) == 4
    assert ring[0] == ring[-1]


def test_an_archive_of_tiles_is_copied_with_a_style(tmp_path: Path) -> None:
    write_archive(tmp_path / "world.pmtiles")

    shown = make(tmp_path / "world.pmtiles", tmp_path / "map")

    assert shown == [LAND]
    copied = (tmp_path / "map/world.pmtiles").read_bytes()
    assert copied == (tmp_path / "world.pmtiles").read_bytes()
    style = read(tmp_path / "map/style.json")
    assert style["sources"]["map"] == {"url": "pmtiles://world.pmtiles", "type": "vector"}
    assert {each.get("source-layer") for each in style["layers"][1:]} == {LAND}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "neither GeoJSON nor PMTiles"),
        (b"\x89PNG....", "neither GeoJSON nor PMTiles"),
        (b"[" * 100_000, "neither GeoJSON nor PMTiles"),
        (b'{"type": "Topology"}', "not a FeatureCollection"),
        (b'{"features": [1]}', "not a FeatureCollection"),
        (b'{"features": []}', "no line and no area"),
        (b"PMTiles\x02", "not PMTiles of version 3"),
    ],
)
def test_other_files_are_refused_with_a_reason(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "file").write_bytes(content)

    with pytest.raises(InvalidInput, match=said):
        make(tmp_path / "file", tmp_path / "map")

    assert not (tmp_path / "map").exists()


@pytest.mark.parametrize("coordinates", [[[0, 0], ["a", 1]], [[0, 0], [1, 91]], [], 7, [[0], [1]]])
def test_coordinates_that_are_no_place_are_refused(tmp_path: Path, coordinates: Any) -> None:
    source = written(tmp_path, [feature("LineString", coordinates, layer="road")])

    with pytest.raises(InvalidInput, match=r"features\.0"):
        make(source, tmp_path / "map")


def test_a_small_archive_cannot_unpack_to_a_huge_description(tmp_path: Path) -> None:
    packed = gzip.compress(b" " * (20 * MOST_METADATA_BYTES))
    header = bytearray(127)
    header[:8] = b"PMTiles\x03"
    header[24:32] = (127).to_bytes(8, "little")
    header[32:40] = len(packed).to_bytes(8, "little")
    header[97], header[99] = 2, 1
    (tmp_path / "bomb.pmtiles").write_bytes(bytes(header) + packed)

    with pytest.raises(InvalidInput, match="cannot be read"):
        make(tmp_path / "bomb.pmtiles", tmp_path / "map")


def test_a_file_inside_the_new_folder_is_refused(tmp_path: Path) -> None:
    source = written(tmp_path, [feature("Polygon", SQUARE)])

    with pytest.raises(InvalidInput, match="lies in the folder"):
        make(source, tmp_path)


@pytest.mark.parametrize(
    ("name", "kind"),
    [("waterway", "river"), ("Water bodies", "water"), ("transportation", "road"), ("poi", None)],
)
def test_names_of_layers_say_what_they_are(name: str, kind: str | None) -> None:
    assert kind_named(name) == kind
