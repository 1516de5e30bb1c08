"""A provider reads the telemetry of its drones, and a drone its own (I13)."""

from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.databases("sqlite")

SECONDS = [f"2026-03-01T12:00:0{second}Z" for second in range(6)]


@pytest.fixture
async def six_samples(history: Any, make_sample: Any) -> Any:
    """A drone that measured once a second for six seconds."""
    await history.keeps(*(make_sample(second, soc=0.9 - second / 10) for second in range(6)))
    return history


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("", SECONDS),
        ("from=2026-03-01T12:00:02Z", SECONDS[2:]),
        ("until=2026-03-01T12:00:02Z", SECONDS[:2]),
        ("from=2026-03-01T13:00:01%2B01:00&until=2026-03-01T12:00:03Z", SECONDS[1:3]),
        ("from=2026-03-01T12:00:03Z&until=2026-03-01T12:00:03Z", []),
        ("from=1970-01-01T00:00:00Z&until=9000-01-01T00:00:00Z", SECONDS),
        ("resolution=minute", SECONDS[:1]),
    ],
)
async def test_telemetry_is_read_by_time(six_samples: Any, query: str, expected: list[str]) -> None:
    assert await six_samples.moments(query) == expected


@pytest.mark.parametrize("query", ["", "&resolution=raw"])
async def test_a_long_period_is_read_in_pages(six_samples: Any, query: str) -> None:
    pages, cursor = [], ""
    while True:
        page = await six_samples.asks(f"limit=4{query}{cursor}")
        pages.append([item["at"] for item in page["items"]])
        if page["next_cursor"] is None:
            break
        cursor = f"&cursor={page['next_cursor']}"

    assert pages == [SECONDS[:4], SECONDS[4:]]


async def test_minutes_are_read_in_pages(history: Any, make_sample: Any) -> None:
    await history.keeps(*(make_sample(20 * number) for number in range(12)))

    first = await history.asks("limit=3&resolution=minute")
    rest = await history.asks(f"limit=3&resolution=minute&cursor={first['next_cursor']}")

    shown = [(item["at"][14:16], item["spread"]["samples"]) for item in first["items"]]
    assert shown == [("00", 3), ("01", 3), ("02", 3)]
    assert [item["at"] for item in rest["items"]] == ["2026-03-01T12:03:00Z"]
    assert rest["next_cursor"] is None


async def test_a_minute_holds_means_extremes_and_the_last_position(
    history: Any, make_sample: Any
) -> None:
    await history.keeps(
        make_sample(10, soc=0.75, power_w=100.0, speed_mps=0.0, position=(-98.0, 29.0)),
        make_sample(40, soc=0.25, power_w=400.0, speed_mps=20.0, position=(-98.2, 29.2)),
        make_sample(30, soc=0.5, power_w=400.0, speed_mps=10.0, position=(-98.1, 29.1)),
    )

    shown = await history.shows("resolution=minute&from=2026-03-01T12:00:35Z")

    assert shown == [
        {
            "at": "2026-03-01T12:00:00Z",
            "position": [-98.2, 29.2],
            "soc": 0.5,
            "power_w": 300.0,
            "speed_mps": 10.0,
            "voltage_v": None,
            "temperature_c": None,
            "range_m": None,
            "spread": {
                "samples": 3,
                "min_soc": 0.25,
                "max_soc": 0.75,
                "min_power_w": 100.0,
                "max_power_w": 400.0,
                "min_speed_mps": 0.0,
                "max_speed_mps": 20.0,
            },
        }
    ]


async def test_a_period_with_too_many_samples_is_shown_by_minutes(
    history: Any, make_sample: Any
) -> None:
    await history.keeps(*(make_sample(number / 10) for number in range(2_001)))

    whole = await history.shows()
    short = await history.shows("until=2026-03-01T12:00:01Z")

    assert [item["spread"]["samples"] for item in whole] == [600, 600, 600, 201]
    assert len(short) == 10


@pytest.mark.parametrize("ask", ["query", "header"])
async def test_a_map_gets_points_with_times(six_samples: Any, ask: str) -> None:
    query, accept = ("format=geojson", "*/*") if ask == "query" else ("", "application/geo+json")

    answer = await six_samples.api.client.get(
        f"{six_samples.path}?limit=1&{query}",
        headers={"Skyway-Caller": f"provider:{six_samples.provider_id}", "Accept": accept},
    )

    assert answer.headers["content-type"] == "application/geo+json"
    collection = answer.json()
    assert isinstance(collection.pop("next_cursor"), str)
    assert collection == {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "geometry": {"type": "Point", "coordinates": [-98.0, 29.5]},
                "properties": {
                    "drone_id": six_samples.drone_id,
                    "at": "2026-03-01T12:00:00.000Z",
                    "soc": 0.9,
                    "power_w": 600.0,
                    "speed_mps": 23.0,
                    "voltage_v": 22.1,
                },
            }
        ],
    }


async def test_a_minute_on_a_map_has_flat_properties(six_samples: Any) -> None:
    collection = await six_samples.asks("format=geojson&resolution=minute")

    properties = collection["features"][0]["properties"]
    assert (properties["samples"], properties["max_soc"]) == (6, 0.9)
    assert all(isinstance(value, (str, int, float)) for value in properties.values())


async def test_a_drone_reads_its_own_telemetry(six_samples: Any) -> None:
    own = await six_samples.api(f"drone:{six_samples.drone_id}", "GET", six_samples.path)

    assert len(own.json()["items"]) == 6


async def test_other_drones_and_providers_may_not_read_it(six_samples: Any) -> None:
    other = await six_samples.api.provider()
    others_drone = (await six_samples.api.drone(other))["drone_id"]
    neighbour = (await six_samples.api.drone(six_samples.provider_id))["drone_id"]
    under_me = six_samples.path.replace(six_samples.provider_id, other)

    answers = [
        await six_samples.api(f"provider:{other}", "GET", six_samples.path),
        await six_samples.api(f"provider:{other}", "GET", under_me),
        await six_samples.api("operator:op", "GET", under_me),
        await six_samples.api(f"drone:{others_drone}", "GET", six_samples.path),
        await six_samples.api(f"drone:{neighbour}", "GET", six_samples.path),
        await six_samples.api(
            "operator:op", "GET", six_samples.path.replace(six_samples.drone_id, "drn_none")
        ),
    ]

    assert [answer.status_code for answer in answers] == [404] * 6


@pytest.mark.parametrize("caller", ["customer:c", None])
async def test_customers_may_not_read_telemetry(six_samples: Any, caller: str | None) -> None:
    assert (await six_samples.api(caller, "GET", six_samples.path)).status_code == 403


async def test_a_removed_drone_is_not_shown(six_samples: Any) -> None:
    drone = six_samples.path.removesuffix("/telemetry")

    await six_samples.api(f"provider:{six_samples.provider_id}", "DELETE", drone)

    assert (await six_samples.api("operator:op", "GET", six_samples.path)).status_code == 404


@pytest.mark.databases("sqlite")
@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("from=yesterday", "from"),
        ("until=2026-03-01T12:00:00", "until"),
        ("resolution=hour", "resolution"),
        ("limit=2001", "limit"),
        ("format=xml", "format"),
        ("from=0001-01-01T00:00:00Z", "from"),
        ("until=9999-12-31T23:59:59Z", "until"),
        ("cursor=x", "cursor"),
        ("cursor=WyJob3VyIiwxXQ", "cursor"),  # ["hour", 1]
        ("cursor=WyJyYXciLC0xXQ", "cursor"),  # ["raw", -1]
        ("resolution=minute&cursor=WyJyYXciLDFd", "cursor"),  # ["raw", 1]
        ("since=2026-03-01T12:00:00Z", "since"),
    ],
)
async def test_an_invalid_query_is_refused(six_samples: Any, query: str, field: str) -> None:
    answer = await six_samples.api(
        f"provider:{six_samples.provider_id}", "GET", f"{six_samples.path}?{query}"
    )

    assert answer.status_code == 422
    assert field in {error["field"].split(".")[-1] for error in answer.json()["errors"]}


async def test_later_samples_can_be_read_from_the_last_one_on(
    six_samples: Any, make_sample: Any
) -> None:
    six_samples.clock.advance(timedelta(seconds=6))
    await six_samples.keeps(make_sample())

    assert await six_samples.moments("from=2026-03-01T12:00:05.001Z") == ["2026-03-01T12:00:06Z"]
