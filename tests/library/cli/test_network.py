"""`skyway network`: networks are built, shown, published and fetched, and say how they are."""

import json
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.network import network_app
from skyway.network.geojson import read_network

runner = CliRunner()


class Gateway(HTTPServer):
    """Answers every call the same and remembers what it was asked."""

    def __init__(self, status: int, answer: Any) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.status, self.answer = status, json.dumps(answer).encode()
        self.calls: list[tuple[str, str, str | None, bytes]] = []


class Handler(BaseHTTPRequestHandler):
    server: Gateway

    def do_GET(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        key = self.headers.get("Authorization")
        self.server.calls.append((self.command, self.path, key, body))
        self.send_response(self.server.status)
        self.send_header("Content-Length", str(len(self.server.answer)))
        self.end_headers()
        self.wfile.write(self.server.answer)

    do_PUT = do_GET  # noqa: N815 - the standard library names it

    def log_request(self, *_: Any) -> None:
        """Keep the test's output free of requests."""


@pytest.fixture
def gateway(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Gateway]:
    """A gateway that answers what the test's parameter says, and keys.env pointing to it."""
    for name in ("SKYWAY_GATEWAY_URL", "SKYWAY_OPERATOR_KEY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("SKYWAY_DATA", str(tmp_path))
    with Gateway(*request.param) as server:
        keys = f"export SKYWAY_GATEWAY_URL=http://127.0.0.1:{server.server_port}\n"
        (tmp_path / "keys.env").write_text(keys + "export SKYWAY_OPERATOR_KEY=sk_1\n")
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def test_build_writes_the_corridor() -> None:
    result = runner.invoke(network_app, ["build", "--max-segment-km", "18"])

    network = read_network(json.loads(result.stdout))

    assert len(network.stations) == 56
    assert max(segment.length_m for segment in network.segments) <= 18_000


def test_build_writes_a_city_of_the_size_asked_for() -> None:
    arguments = ["build", "--kind", "city", "--stations", "12", "--seed", "5"]

    result = runner.invoke(network_app, arguments)

    assert len(read_network(json.loads(result.stdout)).stations) == 12


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--stations", "3"], "--stations has no meaning with --kind texas"),
        (["--kind", "city", "--max-segment-km", "3"], "--max-segment-km has no meaning"),
        (["--kind", "city", "--stations", "0"], "stations: 0 lies outside 1 to"),
    ],
)
def test_build_refuses_options_that_have_no_effect(arguments: list[str], message: str) -> None:
    result = runner.invoke(network_app, ["build", *arguments])

    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stdout == ""


def test_show_prints_the_facts_of_a_network() -> None:
    result = runner.invoke(network_app, ["show", "bundled"])

    for fact in ("56", "386", "59", "6, the largest of 50 stations", "19.9 km"):
        assert fact in result.stdout


def test_show_reads_standard_input() -> None:
    empty = json.dumps({"type": "FeatureCollection", "features": []})

    result = runner.invoke(network_app, ["show", "-"], input=empty)

    assert result.exit_code == 0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not JSON at line 1, column 2"),
        ('{"type": "Feature"}', "type: 'Feature' is not 'FeatureCollection'"),
    ],
)
def test_show_says_what_is_wrong_with_a_file(content: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "network.json"
    file.write_text(content)

    result = runner.invoke(network_app, ["show", str(file)])

    assert result.exit_code == 2
    assert str(file) in result.stderr
    assert message in result.stderr


@pytest.mark.parametrize("gateway", [(200, {"version": 1})], indirect=True)
def test_import_puts_the_network_with_the_operators_key(gateway: Gateway) -> None:
    result = runner.invoke(network_app, ["import", "bundled", "--network-id", "texas"])

    assert result.exit_code == 0
    assert json.loads(result.stdout) == {"version": 1}
    ((method, path, key, body),) = gateway.calls
    assert (method, path, key) == ("PUT", "/v1/networks/texas", "Bearer sk_1")
    assert len(read_network(json.loads(body)).stations) == 56


@pytest.mark.parametrize("gateway", [(200, {"version": 1})], indirect=True)
def test_the_bundled_network_is_published_without_further_options(gateway: Gateway) -> None:
    result = runner.invoke(network_app, ["import", "bundled"])

    assert result.exit_code == 0
    assert [call[:2] for call in gateway.calls] == [("PUT", "/v1/networks/texas-corridor")]


def test_a_file_is_not_published_without_an_id(tmp_path: Path) -> None:
    result = runner.invoke(network_app, ["import", str(tmp_path / "network.json")])

    assert result.exit_code == 2
    assert "--network-id" in result.stderr


@pytest.mark.parametrize(
    "gateway", [(200, {"type": "FeatureCollection", "features": []})], indirect=True
)
def test_export_writes_what_the_gateway_answers(gateway: Gateway) -> None:
    result = runner.invoke(network_app, ["export", "--network-id", "a/b"])

    assert json.loads(result.stdout) == {"type": "FeatureCollection", "features": []}
    assert gateway.calls[0][:2] == ("GET", "/v1/networks/a%2Fb")


PROBLEM = {"title": "Invalid", "detail": "no", "errors": [{"field": "f", "detail": "is bad"}]}


@pytest.mark.parametrize("gateway", [(422, PROBLEM), (409, {"detail": "no"})], indirect=True)
def test_a_problem_is_printed_in_words(gateway: Gateway) -> None:
    result = runner.invoke(network_app, ["import", "bundled", "--network-id", "texas"])

    assert result.exit_code == 1
    assert f"was answered {gateway.status}: no" in result.stderr
    assert ("  f: is bad" in result.stderr) == (gateway.status == 422)


def test_a_gateway_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKYWAY_GATEWAY_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("SKYWAY_OPERATOR_KEY", "sk_1")

    result = runner.invoke(network_app, ["export", "--network-id", "texas"])

    assert result.exit_code == 1
    assert "no answer from http://127.0.0.1:9" in result.stderr


def test_a_missing_key_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKYWAY_DATA", str(tmp_path))
    monkeypatch.setenv("SKYWAY_GATEWAY_URL", "http://127.0.0.1:9")
    for role in ("OPERATOR", "PROVIDER", "CUSTOMER"):
        monkeypatch.delenv(f"SKYWAY_{role}_KEY", raising=False)

    result = runner.invoke(network_app, ["export", "--network-id", "texas"])

    assert result.exit_code == 1
    assert "neither SKYWAY_OPERATOR_KEY nor SKYWAY_PROVIDER_KEY nor" in result.stderr


STATUS = {
    "network_id": "texas-corridor",
    "at": "2026-03-01T12:00:00Z",
    "status": "DEGRADED",
    "restrictions": [
        {"code": "STATION_CLOSED", "detail": "station kyle is closed: roof", "until": None},
        {"code": "ZONE_CLOSED", "detail": "an area is closed", "until": "2026-03-01T13:00:00Z"},
    ],
    "more_restrictions": 7,
    "models": [
        {"model_id": "m", "status": "OPEN", "registered": 4, "online": 3, "idle": 2},
        {"model_id": "n", "status": "PAUSED", "registered": None, "online": None, "idle": None},
    ],
}


@pytest.mark.parametrize("gateway", [(200, STATUS)], indirect=True)
def test_status_says_what_restricts_a_network(gateway: Gateway) -> None:
    result = runner.invoke(network_app, ["status"])

    assert gateway.calls[0][:2] == ("GET", "/v1/networks/texas-corridor/status")
    assert result.stdout.splitlines() == [
        "texas-corridor: DEGRADED",
        "  STATION_CLOSED: station kyle is closed: roof",
        "  ZONE_CLOSED: an area is closed (until 2026-03-01T13:00:00Z)",
        "  and 7 more",
        "  m: OPEN, 4 drones, 3 online, 2 idle",
        "  n: PAUSED",
    ]


FORECAST: Any = {
    "network_id": "texas-corridor",
    "source": "roofs",
    "issued_at": "2026-03-01T12:00:00Z",
    "age_s": 5400.0,
    "phase": "VALID",
    "valid_from_at": "2026-03-01T12:00:00Z",
    "valid_until_at": "2026-03-01T18:00:00Z",
    "fades_until_at": "2026-03-02T06:00:00Z",
}


@pytest.mark.parametrize("gateway", [(200, FORECAST)], indirect=True)
def test_weather_sends_a_forecast_and_shows_the_one_in_force(
    gateway: Gateway, tmp_path: Path
) -> None:
    file = tmp_path / "forecast.json"
    file.write_text('{"source": "roofs"}')

    sent = runner.invoke(network_app, ["weather", str(file)])
    shown = runner.invoke(network_app, ["weather"])

    path = "/v1/networks/texas-corridor/weather"
    assert [call[:2] for call in gateway.calls] == [("PUT", path), ("GET", path)]
    assert gateway.calls[0][3] == file.read_bytes()
    assert sent.stdout == shown.stdout
    assert shown.stdout.splitlines() == [
        (
            "texas-corridor: VALID, from roofs, issued 2026-03-01T12:00:00Z (1.5 h ago), "
            "valid 2026-03-01T12:00:00Z to 2026-03-01T18:00:00Z, fades until 2026-03-02T06:00:00Z"
        )
    ]


def test_weather_refuses_arguments_that_would_be_ignored(tmp_path: Path) -> None:
    for arguments in (["forecast.json", "--remove"], ["--source", "our roofs"]):
        result = runner.invoke(network_app, ["weather", *arguments])
        assert result.exit_code == 2, arguments

    missing = runner.invoke(network_app, ["weather", str(tmp_path / "missing.json")])
    assert missing.exit_code == 2
    assert "missing.json" in missing.stderr
