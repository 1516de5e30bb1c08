"""The story of the day: what happens, what is said about it, and that everything ends again."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import pytest

from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world.fleets import MAX_WIND_MPS
from skyway.cli.small_world.gust import GUST_MPS, calm, passing_gust
from skyway.cli.small_world.story import StoryOfTheDay
from skyway.contracts.weather import ForecastDocument
from skyway.errors import SkywayError
from skyway.ids import StationId
from skyway.network.bundled import texas_corridor
from skyway.network.network import Network

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)


class FreeClock:
    """A clock that is moved by sleeping."""

    rate = 60.0

    def __init__(self) -> None:
        self._now = NOW

    def now(self) -> datetime:
        return self._now

    def wall_now(self) -> datetime:
        return self._now

    def jump(self, fleet_moment: datetime) -> None:
        self._now = max(self._now, fleet_moment)

    async def sleep_until(self, fleet_moment: datetime) -> None:
        self.jump(fleet_moment)


def mission(mission_id: str, *stops: str, is_held: bool = False) -> dict[str, Any]:
    """A mission that picks up at the first stop and delivers at the last."""
    flights = [{"kind": "FLY", "from": start, "to": end} for start, end in pairwise(stops)]
    first = {"kind": "PICK_UP", "station_id": stops[0]}
    last = {"kind": "DELIVER", "station_id": stops[-1]}
    return {
        "mission_id": mission_id,
        "provider_id": "prv_1",
        "drone_id": "drn_1",
        "state": "ACTIVE",
        "is_held": is_held,
        "plan": {"steps": [first, *flights, last]},
    }


class FakeGateway(GatewayApi):
    """Missions in memory; what changes something is noted."""

    def __init__(self, missions: Sequence[dict[str, Any]], *, affected: int = 1) -> None:
        super().__init__("http://gateway")
        self.missions = {each["mission_id"]: each for each in missions}
        self.affected = affected
        self.done: list[tuple[str, Any]] = []
        self.trouble = False

    async def call(self, method: str, path: str, *, key: str, body: Any = None) -> Any:
        if self.trouble:
            raise SkywayError("the gateway starts again")
        if path.startswith("/v1/deliveries"):
            items = [{"reference": "Order 7", "missions": [each]} for each in self._active()]
            return {"items": items}
        if path.startswith("/v1/providers"):
            return {"name": "Bluebonnet"}
        if "dry_run" not in path and method != "GET":
            self.done.append((path, body))
        if path.partition("?")[0].endswith("/closures"):
            return {"affected_missions": ["msn"] * self.affected}
        if path.partition("?")[0].endswith("/commands"):
            landing = {"station_id": "converse", "at": (NOW + timedelta(minutes=5)).isoformat()}
            if "dry_run" not in path:
                self.missions[path.split("/")[3]]["is_held"] = body["command"] == "HOLD"
            return {"outlook": {"next_landing": landing}}
        return {"mission": self.missions.get(path.rpartition("/")[2])}

    def _active(self) -> list[dict[str, Any]]:
        return [each for each in self.missions.values() if each["state"] == "ACTIVE"]


@pytest.fixture(scope="module")
def network() -> Network:
    return texas_corridor()


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def clock() -> FreeClock:
    return FreeClock()


@pytest.fixture
def story_of(network: Network, clock: FreeClock, said: list[str], tmp_path: Path) -> Any:
    """Makes the story of a gateway."""
    return lambda gateway: StoryOfTheDay(
        gateway,
        network,
        operator_key="sk_operator",
        provider_ids=["prv_1"],
        clock=clock,
        chance=Random(1),
        held_file=tmp_path / "held.txt",
        say=said.append,
    )


async def test_a_place_on_the_way_closes_and_opens_again(
    story_of: Any, clock: FreeClock, said: list[str]
) -> None:
    gateway = FakeGateway([mission("msn_1", "live-oak", "converse", "china-grove")])

    assert await story_of(gateway).close_on_the_way()

    [(path, order)] = gateway.done
    assert path == "/v1/stations/converse/closures"
    assert datetime.fromisoformat(order["until"]) == clock.now()
    assert said[0].startswith("12:00: Converse is closed until 12:40: ")
    assert said[1:] == ["12:40: Converse is open again."]


async def test_a_chapter_is_tried_again_before_the_next_one(
    story_of: Any, clock: FreeClock, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    gateway = FakeGateway([mission("msn_1", "live-oak", "converse", "china-grove")], affected=0)

    class EndedStory(Exception):
        """The story has gone on for long enough."""

    async def sleep_until(moment: datetime) -> None:
        clock.jump(moment)
        if clock.now() > NOW + timedelta(minutes=85):
            gateway.affected = 1
        if len(said) > 2:
            raise EndedStory

    monkeypatch.setattr(clock, "sleep_until", sleep_until)

    with pytest.raises(EndedStory):
        await story_of(gateway).run()

    assert "is closed until" in said[0]
    assert "people look at a propeller" in said[2]


async def test_drones_of_other_providers_are_left_alone(story_of: Any, said: list[str]) -> None:
    other = mission("msn_1", "live-oak", "converse", "china-grove") | {"provider_id": "prv_2"}
    gateway = FakeGateway([other])
    story = story_of(gateway)

    for chapter in (story.close_on_the_way, story.delay_a_drone, story.let_a_gust_pass):
        assert not await chapter()

    assert (gateway.done, said) == ([], [])


@pytest.mark.parametrize("affected", [0, 4])
async def test_nothing_closes_that_concerns_nobody_or_many(
    story_of: Any, said: list[str], affected: int
) -> None:
    gateway = FakeGateway([mission("msn_1", "live-oak", "kirby")], affected=affected)

    assert not await story_of(gateway).close_on_the_way()

    assert (gateway.done, said) == ([], [])


async def test_a_drone_waits_at_its_landing_and_flies_on(
    story_of: Any, clock: FreeClock, said: list[str]
) -> None:
    gateway = FakeGateway([mission("msn_1", "live-oak", "converse", "china-grove")])

    assert await story_of(gateway).delay_a_drone()

    assert [body["command"] for _, body in gateway.done] == ["HOLD", "RESUME"]
    assert "Bluebonnet lands at Converse and waits 15 min" in said[0]
    assert "Order 7 comes later" in said[0]
    assert said[1:] == ["12:20: Bluebonnet flies on."]


async def test_a_drone_that_an_earlier_start_held_goes_on(story_of: Any, tmp_path: Path) -> None:
    gateway = FakeGateway([mission("msn_1", "live-oak", "kirby", is_held=True)])
    (tmp_path / "held.txt").write_text("msn_1")

    assert await story_of(gateway)._begin()

    assert [body.get("command") for _, body in gateway.done] == [None, "RESUME"]
    assert not (tmp_path / "held.txt").exists()


async def test_a_gust_passes_and_the_air_is_calm_again(
    story_of: Any, clock: FreeClock, said: list[str]
) -> None:
    gateway = FakeGateway([mission("msn_1", "live-oak", "kirby")])

    assert await story_of(gateway).let_a_gust_pass()

    assert [path for path, _ in gateway.done] == ["/v1/networks/texas-corridor/weather"] * 2
    strongest = [max(map(max, step)) for step in gateway.done[0][1]["grid"]["gust_mps"]]
    assert strongest[0] > MAX_WIND_MPS
    assert strongest[-1] == 0
    assert "gusts of 17 m/s near Kirby" in said[0]
    assert said[1:] == ["12:40: the air is calm again."]


async def test_trouble_is_said_and_the_story_goes_on(story_of: Any, said: list[str]) -> None:
    gateway = FakeGateway([])
    gateway.trouble = True
    story = story_of(gateway)

    assert not await story._has_happened(story.let_a_gust_pass)

    assert said == ["The story of the day goes on later: the gateway starts again"]


def test_both_forecasts_are_valid_and_cover_the_network(network: Network) -> None:
    centre = network.stations[StationId("selma")].position
    for forecast in (calm(network, NOW), passing_gust(network, NOW, centre, timedelta(minutes=40))):
        read = ForecastDocument.model_validate(forecast)
        assert read.grid is not None
        assert read.grid.gust_mps is not None
    assert GUST_MPS > MAX_WIND_MPS
