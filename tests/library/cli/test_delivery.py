"""A customer at the terminal: requests, exit codes, and the words for a plan's proof."""

import json
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.delivery import proof_of
from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

runner = CliRunner()


def test_an_optimal_plan_is_proven():
    plan = {"status": "optimal", "delivery_time_s": 10.0, "lower_bound_s": 10.0}

    assert proof_of(plan) == "proven optimal: no plan delivers earlier"


def test_a_plan_that_a_limit_ended_says_how_much_earlier_another_could_be():
    plan = {"status": "feasible", "delivery_time_s": 1510.0, "lower_bound_s": 10.0}

    assert proof_of(plan).endswith("up to 1,500 s earlier")


def test_a_plan_without_bound_is_not_proven():
    plan = {"status": "feasible", "delivery_time_s": 10.0, "lower_bound_s": None}

    assert proof_of(plan) == "not proven optimal"


NETWORKS = (200, {"items": [{"network_id": "texas"}]})
PROVIDERS = (200, {"items": [{"provider_id": "prv_1"}]})
NOTHING: tuple[int, Any] = (200, {"items": []})


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    """A gateway with a network and a provider, which accepts every delivery request."""
    answering_gateway.answers |= {
        ("GET", "/v1/networks"): NETWORKS,
        ("GET", "/v1/providers"): PROVIDERS,
        ("POST", "/v1/deliveries"): (202, {"delivery_id": "dlv_1"}),
        ("GET", "/v1/deliveries/dlv_1"): (200, {"delivery_id": "dlv_1"}),
    }
    return answering_gateway


def ends_with(gateway: Gateway, event_type: str) -> None:
    """Have the delivery's stream of events end with this event."""
    event = {"type": event_type, "occurred_at": "2026-03-01T12:00:00Z", "data": {}}
    stream = f"id: 1\ndata: {json.dumps(event)}\n\n".encode()
    gateway.answers["GET", "/v1/deliveries/dlv_1/events"] = (200, stream)


@pytest.mark.parametrize("package", ["mcqueeney", "=2"])
def test_a_package_without_mass_or_destination_is_refused_and_nothing_is_sent(
    gateway: Gateway, package: str
) -> None:
    result = runner.invoke(make_app(), ["request", "san-marcos", "-p", package])

    assert result.exit_code == 1
    assert f"--package {package}: write --package PLACE=KG" in result.stderr
    assert gateway.calls == []


def test_a_request_sends_the_mass_of_each_package(gateway: Gateway) -> None:
    result = runner.invoke(make_app(), ["request", "a", "-p", "b=0.8", "-p", "c=2"])

    assert (result.exit_code, result.stdout) == (0, "dlv_1\n")
    sent = gateway.calls[-1][2]
    assert [package["mass_kg"] for package in sent["packages"]] == [0.8, 2.0]


def test_a_request_may_allow_another_pickup_for_a_shared_trip_and_a_quote_may_not(
    gateway: Gateway,
) -> None:
    near = ["a", "-p", "b=1", "--pickup-within-m", "900"]

    assert runner.invoke(make_app(), ["request", *near, "--pooling"]).exit_code == 0
    sent = gateway.calls[-1][2]
    assert sent["qos"]["pickup_within_m"] == 900.0
    alone = runner.invoke(make_app(), ["request", *near])
    assert (alone.exit_code, alone.stderr) == (1, "--pickup-within-m needs --pooling\n")
    # A delivery with an offer joins no trip of others, so the option would do nothing.
    assert runner.invoke(make_app(), ["quote", *near, "--pooling"]).exit_code == 2


@pytest.mark.parametrize(
    ("last_event", "exit_code"),
    [
        ("delivery.completed", 0),
        ("delivery.partially_completed", 3),
        ("delivery.rejected", 1),
        ("delivery.failed", 1),
        ("delivery.cancelled", 1),
    ],
)
@pytest.mark.parametrize("command", [["request", "a", "-p", "b=1", "--follow"], ["track", "dlv_1"]])
def test_the_exit_code_says_how_a_followed_delivery_ended(
    gateway: Gateway, command: list[str], last_event: str, exit_code: int
) -> None:
    ends_with(gateway, last_event)

    assert runner.invoke(make_app(), command).exit_code == exit_code


def test_a_terminal_shows_progress_and_a_program_does_not(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends_with(gateway, "delivery.completed")
    gateway.answers["GET", "/v1/clock"] = (
        200,
        {"fleet_at": "2026-03-01T12:00:00Z", "wall_at": "2026-03-01T12:00:00Z", "rate": 1.0},
    )
    gateway.answers["GET", "/v1/deliveries/dlv_1"] = (
        200,
        {"state": "COMPLETED", "activity": None, "packages": []},
    )
    assert "of 0 delivered" not in runner.invoke(make_app(), ["track", "dlv_1"]).stdout

    monkeypatch.setenv("FORCE_COLOR", "1")  # rich then takes the output for a terminal
    at_terminal = runner.invoke(make_app(), ["track", "dlv_1"])
    as_json = runner.invoke(make_app(), ["track", "dlv_1", "--json"])

    assert (at_terminal.exit_code, as_json.exit_code) == (0, 0)
    assert "completed, 0 of 0 delivered" in at_terminal.stdout
    assert "delivered" not in as_json.stdout


def test_a_request_without_a_network_says_how_to_publish_one(gateway: Gateway) -> None:
    gateway.answers["GET", "/v1/networks"] = NOTHING

    result = runner.invoke(make_app(), ["request", "a", "-p", "b=1"])

    assert result.exit_code == 1
    assert result.stderr == "no network is published: skyway network import bundled\n"
    assert ("POST", "/v1/deliveries") not in gateway.called


def test_a_request_without_providers_is_sent_and_says_that_no_provider_can_fly_it(
    gateway: Gateway,
) -> None:
    gateway.answers["GET", "/v1/providers"] = NOTHING

    result = runner.invoke(make_app(), ["request", "a", "-p", "b=1"])

    assert (result.exit_code, result.stdout) == (0, "dlv_1\n")
    assert "no provider is registered yet" in result.stderr
