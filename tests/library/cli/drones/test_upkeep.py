"""`skyway battery` and `skyway maintenance`: batteries, rules, and what is due."""

import json
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

FLEET = "/v1/providers/prv_1"
PROVIDERS = [
    {"provider_id": "prv_1", "name": "Hill Country Drones"},
    {"provider_id": "prv_2", "name": "Alamo Air\x1b[2J Delivery"},
]
BATTERY: dict[str, Any] = {
    "battery_id": "bat_1",
    "serial": "TB60-0042",
    "model_id": "paper-scenario",
    "drone_id": None,
    "installed_at": None,
    "cycles": 57.31,
    "state_of_health": 0.93,
    "past_installations": [
        {
            "drone_id": "drn_1",
            "installed_at": "2026-03-01T12:00:00Z",
            "removed_at": "2026-03-09T12:00:00Z",
            "cycles": 12.5,
        }
    ],
}
LINE = "bat_1  TB60-0042  paper-scenario  in no drone  57.3 cycles  health 93%\n"
WEAR = "paper-scenario  41.0 h in the air and 73.0 cycles since its registration"
RULE = {"model_id": "paper-scenario", "every_flight_hours": 100.0, "every_cycles": None}


def make_drone(drone_id: str, **maintenance: Any) -> dict[str, Any]:
    wear = {"flight_hours": 41.0, "cycles": 73.0, "maintained_at": None, "due_since_at": None}
    return {
        "drone_id": drone_id,
        "name": "Falcon" if drone_id == "drn_1" else None,
        "model_id": "paper-scenario",
        "battery_id": None,
        "maintenance": wear | maintenance,
    }


DUE = make_drone("drn_2", due_since_at="2026-03-02T12:00:00Z")


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    installed = make_drone("drn_1") | {"battery_id": "bat_1"}
    answering_gateway.answers |= {
        ("GET", "/v1/providers"): (200, {"items": PROVIDERS[:1], "next_cursor": None}),
        ("GET", f"{FLEET}/batteries"): (200, {"items": [BATTERY], "next_cursor": None}),
        ("GET", f"{FLEET}/batteries/bat_1"): (200, BATTERY),
        ("POST", f"{FLEET}/batteries"): (201, BATTERY),
        ("DELETE", f"{FLEET}/batteries/bat_1"): (204, b""),
        ("PUT", f"{FLEET}/drones/drn_1/battery"): (200, installed),
        ("DELETE", f"{FLEET}/drones/drn_1/battery"): (200, make_drone("drn_1")),
        ("GET", f"{FLEET}/drones"): (
            200,
            {"items": [make_drone("drn_1"), DUE], "next_cursor": None},
        ),
        ("POST", f"{FLEET}/drones/drn_1/maintenance"): (
            200,
            make_drone("drn_1", flight_hours=0.0, cycles=0.0, maintained_at="2026-03-03T12:00:00Z"),
        ),
        ("GET", f"{FLEET}/maintenance-rules"): (200, {"items": [RULE]}),
        ("PUT", f"{FLEET}/maintenance-rules/paper-scenario"): (200, RULE),
        ("DELETE", f"{FLEET}/maintenance-rules/paper-scenario"): (204, b""),
    }
    return answering_gateway


def run(*arguments: str) -> Any:
    return CliRunner().invoke(make_app(), arguments)


@pytest.mark.parametrize(
    ("command", "call", "printed"),
    [
        ("battery list", ("GET", "/batteries", None), LINE),
        (
            "battery show bat_1",
            ("GET", "/batteries/bat_1", None),
            f"{LINE}  drn_1  2026-03-01T12:00:00Z to 2026-03-09T12:00:00Z  12.5 cycles\n",
        ),
        (
            "battery register TB60-0042 --model paper-scenario --capacity-j 950000",
            (
                "POST",
                "/batteries",
                {"serial": "TB60-0042", "model_id": "paper-scenario", "capacity_j": 950_000.0},
            ),
            LINE,
        ),
        (
            "battery install drn_1 bat_1",
            ("PUT", "/drones/drn_1/battery", {"battery_id": "bat_1"}),
            "drn_1 (Falcon) has bat_1\n",
        ),
        (
            "battery remove drn_1",
            ("DELETE", "/drones/drn_1/battery", None),
            "drn_1 (Falcon) has no registered battery\n",
        ),
        ("battery delete bat_1", ("DELETE", "/batteries/bat_1", None), "bat_1 is deleted\n"),
        (
            "maintenance list",
            ("GET", "/drones", None),
            f"drn_1 (Falcon)  {WEAR}\ndrn_2  {WEAR}, due since 2026-03-02T12:00:00Z\n",
        ),
        (
            "maintenance done drn_1",
            ("POST", "/drones/drn_1/maintenance", None),
            (
                "drn_1 (Falcon)  paper-scenario  0.0 h in the air and 0.0 cycles since "
                "2026-03-03T12:00:00Z\n"
            ),
        ),
        (
            "maintenance rules",
            ("GET", "/maintenance-rules", None),
            "paper-scenario: due every 100 h in the air\n",
        ),
        (
            "maintenance rule paper-scenario --hours 100",
            (
                "PUT",
                "/maintenance-rules/paper-scenario",
                {"every_flight_hours": 100.0, "every_cycles": None},
            ),
            "paper-scenario: due every 100 h in the air\n",
        ),
        (
            "maintenance rule paper-scenario --remove",
            ("DELETE", "/maintenance-rules/paper-scenario", None),
            "paper-scenario: no rule\n",
        ),
    ],
)
def test_each_command_calls_its_route_and_prints_the_answer(
    gateway: Gateway, command: str, call: tuple[str, str, Any], printed: str
) -> None:
    result = run(*command.split(), "--provider", "prv_1")

    method, below, body = call
    assert gateway.calls == [(method, FLEET + below, body)]
    assert (result.exit_code, result.stdout) == (0, printed)


def test_the_due_list_as_json_has_only_drones_that_are_due(gateway: Gateway) -> None:
    result = run("maintenance", "list", "--due", "--json")

    assert [each["drone_id"] for each in json.loads(result.stdout)] == ["drn_2"]


def test_all_pages_of_a_list_are_read(gateway: Gateway) -> None:
    first = {"items": [BATTERY], "next_cursor": "abc"}
    gateway.answers["GET", f"{FLEET}/batteries?limit=200"] = (200, first)

    assert run("battery", "list").stdout == LINE * 2
    assert gateway.queries[-2:] == ["limit=200", "limit=200&cursor=abc"]


def test_without_a_provider_the_only_one_counts(gateway: Gateway) -> None:
    assert run("battery", "list").stdout == LINE

    gateway.answers["GET", "/v1/providers"] = (200, {"items": PROVIDERS, "next_cursor": None})
    several = run("battery", "list")
    gateway.answers["GET", "/v1/providers"] = (200, {"items": [], "next_cursor": None})
    none = run("battery", "list")

    assert several.exit_code == 1
    assert several.stderr.splitlines()[:2] == [
        "name the provider; for example",
        "  --provider prv_1 (Hill Country Drones)",
    ]
    assert "\x1b" not in several.stderr
    assert (none.exit_code, none.stderr) == (1, "no provider is registered\n")


def test_a_provider_is_named_by_its_id_or_by_its_name(gateway: Gateway) -> None:
    gateway.answers["GET", "/v1/providers"] = (200, {"items": PROVIDERS, "next_cursor": None})

    by_name = run("battery", "list", "--provider", "hill country DRONES")
    unknown = run("battery", "list", "--provider", "Hill")

    assert by_name.stdout == LINE
    assert (unknown.exit_code, unknown.stderr.splitlines()[0]) == (
        1,
        "no provider 'Hill'; for example",
    )


@pytest.mark.parametrize("options", ["", "--remove --hours 5"])
def test_a_rule_has_a_limit_or_is_removed(gateway: Gateway, options: str) -> None:
    result = run("maintenance", "rule", "paper-scenario", *options.split())

    assert result.exit_code == 2
    assert gateway.calls == []


def test_a_refusal_names_the_option(gateway: Gateway) -> None:
    fault = {"field": "capacity_j", "detail": "1 J is below the limit"}
    gateway.answers["POST", f"{FLEET}/batteries"] = (422, {"detail": "", "errors": [fault]})

    result = run("battery", "register", "TB60", "--model", "paper-scenario", "--capacity-j", "1")

    assert result.exit_code == 1
    assert "--capacity-j: 1 J is below the limit" in result.stderr


def test_empty_lists_say_so(gateway: Gateway) -> None:
    nothing: Any = (200, {"items": [], "next_cursor": None})
    for below in ("batteries", "drones", "maintenance-rules"):
        gateway.answers["GET", f"{FLEET}/{below}"] = nothing

    assert run("battery", "list").stdout == "no batteries\n"
    assert run("maintenance", "list").stdout == "no drones\n"
    assert run("maintenance", "list", "--due").stdout == "no drone is due\n"
    assert run("maintenance", "rules").stdout == "no rules: no drone is due\n"
