"""Mistakes that people make in their first hour, and the words that help them on.

Each row is a command or a call, and words of its answer. No answer shows the words of a library.
"""

from typing import Any, Final

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.end_to_end.eventually import eventually
from tests.end_to_end.local_system import LocalSystem

pytestmark = [pytest.mark.long, pytest.mark.storage_pair("embedded")]

#: Words of libraries and of Python, which say nothing to users.
FOREIGN: Final = (
    "Traceback",
    "Extra inputs",
    "Input should be",
    "Expecting",
    "Errno",
    "not a valid float range",
    "datetime.",
    "pydantic",
)

HERE, THERE = "oops-s1", "oops-s3"

COMMANDS: Final[tuple[tuple[tuple[str, ...], str], ...]] = (
    (("request", "oops-ss1", "-p", f"{THERE}=0.5"), "no station is called 'oops-ss1'"),
    (("request", HERE, "-p", "oops-3=0.5"), "did you mean 'oops-s3'"),
    (("request", HERE, "-p", f"{THERE}=0,5"), "'0,5' is not a mass in kg"),
    (("request", HERE, "-p", f"{THERE}=-1"), "packages.0.mass_kg: must be at least"),
    (("request", HERE, "-p", THERE), "write --package PLACE=KG"),
    (("request", HERE, "-p", f"{HERE}=1"), "is the pickup: choose another station"),
    (("request", HERE), "give a pickup and at least one --package"),
    (("request", "Oops S9", "-p", f"{THERE}=1"), "the embedded geocoder knows names"),
    (("request", HERE, "-p", f"{THERE}=1", "--objective", "quickest"), "'quickest' is not one of"),
    (
        ("request", HERE, "-p", f"{THERE}=1", "--latest", "2020-01-01T00:00:00Z"),
        "is in the past: fleet time is",
    ),
    (("request", HERE, "-p", f"{THERE}=1", "--latest", "tomorrow"), "write 2026-03-02T14:00:00Z"),
    (("request", HERE, "-p", f"{THERE}=1", "--latest", "2030-01-01T00:00:00"), "the time zone is"),
    (("quote", HERE, "-p", f"{THERE}=1", "--priority", "urgent"), "is not one of"),
    (("track", "dlv_nothing"), "no delivery 'dlv_nothing'"),
    (("network", "import", "nofile.json", "--network-id", "x"), "nofile.json"),
    (("network", "import", "/", "--network-id", "x"), "directory"),
    (("network", "import", __file__, "--network-id", "x"), "not JSON"),
    (("network", "export", "--network-id", "texas"), "no network 'texas'"),
    (("fleet", "--drones", "0"), "--drones"),
    (("fleet", "--drones", "1", "--home", "atlantis"), "no station 'atlantis'"),
    (("fleet", "--drones", "1", "--model", "phantom"), "no drone model 'phantom'"),
    (("fleet",), "give FILE, or --drones N, or both"),
    (("schedule", "--drone", "drn_x"), "no drone 'drn_x'"),
    (("maintenance", "list", "--provider", "Nobody"), "provider"),
    (("close", "station", "atlantis"), "no station 'atlantis'"),
    (("close", "pad", HERE, "99"), "99"),
    (("close", "zone", "oops", __file__), "not JSON"),
    (("compose", __file__), "not JSON"),
    (("compose", "nothing.json"), "nothing.json"),
    (("mission", "hold", "msn_x", "--reason", "x"), "no mission 'msn_x'"),
    (("alarms", "--note", "x"), "--note goes with --acknowledge"),
)

PACKAGE: Final = {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": THERE}}
REQUEST: Final = {"pickup": {"station_id": HERE}, "packages": [PACKAGE]}

CALLS: Final[tuple[tuple[str, str, Any, str], ...]] = (
    ("POST", "/v1/deliveries", {"pickup": HERE}, "pickup: must be an object"),
    ("POST", "/v1/deliveries", {**REQUEST, "packages": []}, "at least one package must be given"),
    ("POST", "/v1/deliveries", {**REQUEST, "notes": "ring twice"}, "notes: is not a known field"),
    ("POST", "/v1/deliveries", None, "body: is missing"),
    (
        "POST",
        "/v1/deliveries",
        {**REQUEST, "packages": [{**PACKAGE, "mass_kg": "0.5"}]},
        "packages.0.mass_kg: must be a number",
    ),
    (
        "POST",
        "/v1/deliveries",
        {**REQUEST, "qos": {"objective": "fastest"}},
        "qos.objective: must be 'FASTEST', 'CHEAPEST' or 'GREENEST'",
    ),
    (
        "POST",
        "/v1/deliveries",
        {**REQUEST, "earliest_pickup_at": 1_795_428_000},
        "earliest_pickup_at: must be a moment",
    ),
    ("POST", "/v1/delivery", REQUEST, "no call has the path /v1/delivery"),
    ("PUT", "/v1/deliveries/dlv_1", {}, "PUT is no method of this path"),
    ("GET", "/v1/deliveries?limit=1000", None, "limit: must be at most 200"),
    ("GET", "/v1/deliveries?state=DONE", None, "state: must be 'SCHEDULED'"),
    ("GET", "/v1/alarms", None, "this is for the role provider or operator, not customer"),
    ("GET", "/v1/providers/prv_x", None, "no provider 'prv_x'"),
    ("POST", "/v1/webhooks", {"url": "example.com/in"}, "url: must begin with http:// or https://"),
    (
        "POST",
        "/v1/webhooks",
        {"url": "http://127.0.0.1:9/", "event_types": ["delivered"]},
        "event_types.0: must be 'delivery.requested'",
    ),
    ("POST", "/v1/webhooks", {"url": "http://10.0.0.1/"}, "not a public address"),
)


def test_at_least_47_mistakes_are_tried() -> None:
    assert len(COMMANDS) + len(CALLS) >= 47


@pytest.fixture(scope="module")
def network(running_system: LocalSystem) -> LocalSystem:
    running_system.publish_corridor("oops")
    key = running_system.keys["SKYWAY_CUSTOMER_KEY"]

    def is_known() -> bool:
        """Whether the gateway has learned the stations that it looks for places."""
        path = "/v1/places?address=Oops%20S1"
        return running_system.call("GET", path, key=key).status_code != 409

    eventually(is_known, "the gateway knows the network")
    return running_system


@pytest.mark.parametrize(("command", "words"), COMMANDS)
def test_a_wrong_command_ends_with_words_that_help(
    network: LocalSystem, command: tuple[str, ...], words: str
) -> None:
    result = CliRunner(env={"SKYWAY_DATA": str(network.folder.path)}).invoke(make_app(), command)

    assert result.exit_code in (1, 2)
    assert words in " ".join(result.output.split())
    assert not [each for each in FOREIGN if each in result.output]


@pytest.mark.parametrize(("method", "path", "body", "words"), CALLS)
def test_a_wrong_call_is_answered_with_words_that_help(
    network: LocalSystem, method: str, path: str, body: Any, words: str
) -> None:
    key = network.keys["SKYWAY_CUSTOMER_KEY"]

    answer = network.call(method, path, key=key, body=body)

    assert 400 <= answer.status_code < 500
    assert words in answer.json()["detail"]
    assert not [each for each in FOREIGN if each in answer.text]
