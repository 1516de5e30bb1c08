"""A geocoder over HTTP: its forms, its cache, and all that it may answer instead."""

import logging
from collections.abc import AsyncIterator, Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import httpx
import pytest
from skyway_gateway.places.http_geocoder import HttpGeocoder

from skyway.geo import Position
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable

_URL = "https://geo.example/search?limit=5&q={address}"


def feature(longitude: object, latitude: object, **properties: Any) -> dict[str, Any]:
    point = {"type": "Point", "coordinates": [longitude, latitude]}
    return {"type": "Feature", "geometry": point, "properties": properties}


class Server:
    """Answers each request the same, and remembers the URLs."""

    def __init__(self, answer: Callable[[], httpx.Response]) -> None:
        self.answer = answer
        self.urls: list[str] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.urls.append(str(request.url))
        return self.answer()


def collection(*features: Any) -> httpx.Response:
    return httpx.Response(200, json={"type": "FeatureCollection", "features": list(features)})


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(datetime(2026, 3, 2, 9, tzinfo=UTC))


@pytest.fixture
async def opened(clock: ManualClock) -> AsyncIterator[Callable[[Server], HttpGeocoder]]:
    made: list[HttpGeocoder] = []

    def make(server: Server) -> HttpGeocoder:
        made.append(HttpGeocoder(_URL, clock, transport=httpx.MockTransport(server)))
        return made[-1]

    yield make
    for each in made:
        await each.close()


Opened = Callable[[Server], HttpGeocoder]


@pytest.mark.parametrize(
    ("properties", "label"),
    [
        (
            {"name": "Rathaus", "street": "Platz", "housenumber": "1", "city": "Wien"},
            "Rathaus, Platz, 1, Wien",
        ),
        ({"label": "Rathaus, Wien", "name": "Rathaus"}, "Rathaus, Wien"),
        ({"display_name": "Rathaus, Wien, Österreich"}, "Rathaus, Wien, Österreich"),
        ({"label": "x\x1b[31m" + "y" * 300}, "x[31m" + "y" * 195),
    ],
)
async def test_photon_pelias_and_nominatim_are_read(
    opened: Opened, properties: dict[str, str], label: str
) -> None:
    geocoder = opened(Server(lambda: collection(feature(16.4, 48.2, **properties))))

    assert await geocoder.find("Rathaus") == ((label, Position(16.4, 48.2)),)


@pytest.mark.parametrize("properties", ["text", ["list"], 5])
async def test_features_with_strange_properties_are_left_out(
    opened: Opened, properties: object
) -> None:
    strange = {**feature(16.4, 48.2), "properties": properties}
    geocoder = opened(Server(lambda: collection(strange, feature(1, 2, label="good"))))

    assert await geocoder.find("x") == (("good", Position(1, 2)),)


async def test_the_address_is_quoted_and_asked_once(opened: Opened, clock: ManualClock) -> None:
    server = Server(lambda: collection(feature(16.4, 48.2)))
    geocoder = opened(server)

    for _ in range(3):
        await geocoder.find("Platz 1 &q=x/{address}")
    assert server.urls == [
        "https://geo.example/search?limit=5&q=Platz%201%20%26q%3Dx%2F%7Baddress%7D"
    ]
    clock.advance(timedelta(hours=2))
    await geocoder.find("Platz 1 &q=x/{address}")
    assert len(server.urls) == 2


async def test_features_without_a_valid_point_are_left_out(opened: Opened) -> None:
    wrong: tuple[Any, ...] = (
        feature(16.4, 95.0),
        feature("16.4", 48.2),
        feature(None, None),
        {"geometry": None},
        7,
    )

    assert await opened(Server(lambda: collection(*wrong[1:], feature(1.0, 2.0)))).find("a") == (
        ("", Position(1.0, 2.0)),
    )
    assert await opened(Server(lambda: collection(*wrong))).find("a") == ()


async def test_five_places_of_an_answer_are_looked_at(opened: Opened) -> None:
    geocoder = opened(Server(lambda: collection(*(feature(1.0, float(n)) for n in range(50)))))

    assert len(await geocoder.find("a")) == 5


def _lost() -> httpx.Response:
    raise httpx.ConnectError(f"no way to {_URL} Secret Street")


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (lambda: httpx.Response(500), "status 500"),
        (lambda: httpx.Response(302, headers={"location": "http://127.0.0.1/"}), "status 302"),
        (lambda: httpx.Response(200, content=b"<html>"), "not GeoJSON"),
        (lambda: httpx.Response(200, content=b"[" * 200_000), "not GeoJSON"),
        (lambda: httpx.Response(200, json={"features": {}}), "not GeoJSON"),
        (lambda: httpx.Response(200, content=b" " * 300_000), "more than 262144 bytes"),
        (_lost, "ConnectError"),
    ],
)
async def test_a_failing_geocoder_is_named_and_nothing_is_guessed_or_logged(
    opened: Opened, caplog: pytest.LogCaptureFixture, answer: Callable[[], httpx.Response], why: str
) -> None:
    caplog.set_level(logging.INFO, logger="skyway_gateway")
    server = Server(answer)

    with pytest.raises(ServiceUnavailable, match=why) as failed:
        await opened(server).find("Secret Street")

    assert "the geocoder is unavailable" in str(failed.value)
    assert "Secret" not in str(failed.value) + caplog.text
    assert len(server.urls) == 1
