"""`skyway top` shows the gateway's answers on one screen, and says when there is no answer."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from rich.console import Console
from typer.testing import CliRunner

from skyway.cli.main import make_app
from skyway.cli.top import MessageCounts, NoAnswer, TopReader, TopScreen

ALARM = {
    "at": "2026-03-01T12:34:56Z",
    "level": "CRITICAL",
    "code": "FORCED_LANDING",
    "drone_id": "drn_01m7zr11rd0wr1te7yaxwwrjm3",
    "mission_id": "msn_7",
    "station_id": None,
    "detail": "it is down in a field, 140 m from the nearest road",
}

METRICS = """\
# HELP skyway_delivery_events_total events sent to customers
skyway_delivery_events_total{type="delivery.replanned"} 3.0
skyway_delivery_events_total{type="delivery.completed"} 9.0
"""


class Gateway:
    """Answers as a gateway does; `asked` are the paths."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.states = 10
        self.is_away = False
        self.waiting: Any = {
            "by_age": [{"up_to_s": 60, "requests": 6}, {"up_to_s": None, "requests": 2}]
        }

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if self.is_away:
            raise httpx.ConnectError("refused")
        path = request.url.path
        key = "mk_metrics" if path == "/metrics" else "sk_op"
        assert request.headers["Authorization"] == f"Bearer {key}"
        self.asked.append(path)
        if path == "/metrics":
            return httpx.Response(200, text=METRICS)
        return httpx.Response(200, json=self._json(path))

    def _json(self, path: str) -> Any:
        if path == "/v1/stats/fleets":
            return {
                "at": "2026-03-01T12:35:00Z",
                "drones": 1_040,
                "by_state": {"AVAILABLE": 1_039, "GROUNDED": 1},
                "next_free_at": "2026-03-01T13:02:40Z",
                "states": self.states,
                "samples": 50,
                "lag_mean_s": 0.25,
                "lag_max_s": 1.5,
            }
        return {
            "/v1/stats/missions": {"by_state": {"ACTIVE": 24}, "unsent": {"mqtt": 5}},
            "/v1/alarms": {"items": [ALARM], "next_cursor": None},
            "/v1/stats/deliveries": {
                "by_state": {"COMPLETED": 17},
                "waiting": self.waiting,
            },
        }[path]


@pytest.fixture
def gateway() -> Gateway:
    return Gateway()


@pytest.fixture
def reader(gateway: Gateway) -> TopReader:
    return reader_of(gateway, metrics_key="mk_metrics")


def reader_of(gateway: Gateway, *, metrics_key: str | None) -> TopReader:
    transport = httpx.MockTransport(gateway)
    return TopReader("http://gateway", key="sk_op", metrics_key=metrics_key, transport=transport)


@pytest.fixture
def printed(reader: TopReader) -> Callable[[], str]:
    def show() -> str:
        console = Console(width=160, force_terminal=False)
        with console.capture() as captured:
            console.print(TopScreen(console).shown(reader.read()))
        return captured.get()

    return show


def test_all_numbers_are_on_the_screen(printed: Callable[[], str]) -> None:
    screen = printed()

    for words in ("1,040", "AVAILABLE", "1,039", "GROUNDED", "ACTIVE", "COMPLETED", "17"):
        assert words in screen
    for words in ("0.25 s", "1.50 s", "CRITICAL", "FORCED_LANDING", "drn_01m7zr11rd", "12:34:56"):
        assert words in screen
    assert "waiting to leave, mqtt" in screen
    for words in ("next busy drone free in 0:27:40", "up to 1 min", "over 1 min"):
        assert words in screen


def test_an_alarm_can_be_read_on_a_narrow_screen(reader: TopReader) -> None:
    console = Console(width=80, force_terminal=False)

    with console.capture() as captured:
        console.print(TopScreen(console).shown(reader.read()))

    assert "CRITICAL  FORCED_LANDING  drn_01m7zr11rd0wr1te7yaxwwrjm3" in captured.get()
    assert "it is down in a field, 140 m from the nearest road" in captured.get()


def test_without_the_metrics_key_recompositions_are_unknown(gateway: Gateway) -> None:
    reader = reader_of(gateway, metrics_key=None)

    assert reader.read().recompositions is None
    assert "/metrics" not in gateway.asked


def test_recompositions_count_the_replans_announced_to_customers(reader: TopReader) -> None:
    assert reader.read().recompositions == 3


def test_a_provider_sees_its_fleet_but_no_waiting_requests(
    reader: TopReader, gateway: Gateway
) -> None:
    gateway.waiting = None

    assert reader.read().waiting == {}


def test_rates_are_shown_from_the_second_read_on(reader: TopReader, gateway: Gateway) -> None:
    first = reader.read()
    gateway.states += 5
    second = reader.read()

    assert first.states_per_s is None
    assert second.states_per_s is not None
    assert second.states_per_s > 0
    assert second.samples_per_s == 0


def test_a_rate_is_the_number_of_messages_per_second() -> None:
    before, after = (
        MessageCounts(10.0, states=100, samples=7),
        MessageCounts(12.0, states=150, samples=3),
    )

    assert after.states_since(before) == 25.0
    assert after.samples_since(before) == 0.0


def test_a_days_deliveries_are_not_read_each_second(reader: TopReader, gateway: Gateway) -> None:
    reader.read()
    reader.read()

    assert gateway.asked.count("/v1/stats/deliveries") == 1
    assert gateway.asked.count("/v1/stats/fleets") == 2


def test_a_silent_gateway_is_an_error(reader: TopReader, gateway: Gateway) -> None:
    gateway.is_away = True

    with pytest.raises(NoAnswer, match=r"no answer from http://gateway: .*skyway up"):
        reader.read()


def test_the_screen_keeps_the_last_picture_while_the_gateway_is_silent(reader: TopReader) -> None:
    console = Console(width=160, force_terminal=True)
    with console.capture() as captured, TopScreen(console) as screen:
        screen.show(reader.read())
        screen.show_silence("no answer")

    assert "no answer" in captured.get()
    assert captured.get().count("AVAILABLE") >= 2


def test_the_command_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SKYWAY_GATEWAY_URL", raising=False)
    monkeypatch.delenv("SKYWAY_OPERATOR_KEY", raising=False)

    ended = CliRunner().invoke(make_app(), ["top", "--once", "--data", str(tmp_path)])

    assert ended.exit_code == 1
    assert "SKYWAY_GATEWAY_URL is not set" in ended.output
