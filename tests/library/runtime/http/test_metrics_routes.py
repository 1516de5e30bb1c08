"""GET /metrics, for those with the metrics key."""

from collections.abc import AsyncIterator, Callable
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from skyway.runtime.http.metrics_routes import MetricsGate, metrics_routes
from skyway.runtime.metrics import DURATIONS, METRICS_KEY, Gauge, Gauges, GaugeSource


async def one_drone() -> list[Gauge]:
    return [Gauge("skyway_loads_drones", "drones of this test", 1.0, {"state": "IDLE"})]


KEY = {"Authorization": "Bearer mk_right"}


@pytest.fixture
async def scraped(
    make_app: Callable[..., FastAPI], tmp_path: Path
) -> AsyncIterator[httpx.AsyncClient]:
    (tmp_path / METRICS_KEY).write_text("mk_right\n")
    app = make_app()
    gauges = Gauges()
    gauges.show(GaugeSource("drones", one_drone))
    app.routes.extend(metrics_routes(gate=MetricsGate(tmp_path), gauges=gauges).routes)
    transport = httpx.ASGITransport(app)
    async with httpx.AsyncClient(transport=transport, base_url="http://loads") as opened:
        yield opened


async def test_requests_are_counted(scraped: httpx.AsyncClient) -> None:
    await scraped.get("/loads")

    text = (await scraped.get("/metrics", headers=KEY)).text

    assert 'skyway_http_requests_total{method="GET",route="/loads",status="200"}' in text


async def test_the_time_until_an_answer_is_a_histogram_by_route_and_class(
    scraped: httpx.AsyncClient,
) -> None:
    labels = {"method": "GET", "route": "/loads", "status": "2xx"}
    before = DURATIONS.count_of("skyway_http_request_duration_seconds", **labels)

    await scraped.get("/loads")

    assert DURATIONS.count_of("skyway_http_request_duration_seconds", **labels) == before + 1
    text = (await scraped.get("/metrics", headers=KEY)).text
    series = 'skyway_http_request_duration_seconds_bucket{le="+Inf",method="GET",route="/loads"'
    assert series in text


async def test_unknown_paths_and_refusals_share_a_series(scraped: httpx.AsyncClient) -> None:
    labels = {"method": "GET", "route": "", "status": "4xx"}
    before = DURATIONS.count_of("skyway_http_request_duration_seconds", **labels)

    await scraped.get("/nowhere/1")
    await scraped.get("/nowhere/2")

    assert DURATIONS.count_of("skyway_http_request_duration_seconds", **labels) == before + 2


async def test_gauges_are_shown(scraped: httpx.AsyncClient) -> None:
    text = (await scraped.get("/metrics", headers=KEY)).text

    assert 'skyway_loads_drones{state="IDLE"} 1.0' in text


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Authorization": "Bearer"},
        {"Authorization": "Bearer mk_wrong"},
        {"Authorization": "Basic mk_right"},
        {"Authorization": "Bearer mk_\u00fc"},
    ],
)
async def test_metrics_need_the_key(
    scraped: httpx.AsyncClient, headers: dict[str, str], assert_is_problem: Callable[..., None]
) -> None:
    encoded = [(name.encode(), value.encode("latin-1")) for name, value in headers.items()]

    assert_is_problem(await scraped.get("/metrics", headers=encoded), 401, "unauthenticated")


async def test_another_key_in_the_file_counts_immediately(
    scraped: httpx.AsyncClient, tmp_path: Path
) -> None:
    (tmp_path / METRICS_KEY).write_text("mk_next")

    assert (await scraped.get("/metrics", headers=KEY)).status_code == 401
    next_key = {"Authorization": "Bearer mk_next"}
    assert (await scraped.get("/metrics", headers=next_key)).status_code == 200


async def test_without_the_file_nobody_reads_metrics(
    scraped: httpx.AsyncClient, tmp_path: Path
) -> None:
    (tmp_path / METRICS_KEY).unlink()

    answer = await scraped.get("/metrics", headers=KEY)

    assert answer.status_code == 401
    assert "no metrics key" in answer.json()["detail"]
