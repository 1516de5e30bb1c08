"""A customer at the terminal: offers, accepting one, and the options of a request."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

runner = CliRunner()

ASKED = ["quote", "a", "-p", "b=1", "-p", "c=2"]

OFFER = {
    "offer_id": "off_1",
    "provider_id": "prv_1",
    "price": {"amount": 1250, "currency": "USD"},
    "pickup_station_id": "a",
    "pickup_at": "2026-03-02T10:00:00Z",
    "margins": {},
    "packages": [
        {
            "package_id": "p1",
            "destination_station_id": "b",
            "eta_at": "2026-03-02T11:00:00.500Z",
            "eta_p90_at": "2026-03-02T11:09:00Z",
        }
    ],
    "expires_wall_at": "2026-03-02T09:00:00Z",
    "is_held": True,
}


def quote_with(*offers: dict[str, Any]) -> dict[str, Any]:
    """The gateway's answer with these offers, and a provider that makes none."""
    busy = {"provider_id": "prv_2", "code": "BUSY", "detail": "all drones are busy"}
    near = [{"station_id": each, "walk_m": 120.4} for each in ("b", "c")]
    place = {"fields": ["pickup"], "served_by": near[0], "alternatives": near[1:]}
    return {
        "quote_id": "quo_1",
        "made_at": "2026-03-02T08:00:00Z",
        "places": [place],
        "offers": offers,
        "infeasible": [busy],
    }


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    """A gateway that answers each request with one offer."""
    answering_gateway.answers |= {
        ("GET", "/v1/clock"): (200, {"now": "2026-03-02T08:00:00Z"}),
        ("GET", "/v1/providers"): (200, {"items": [{"provider_id": "prv_1", "name": "Alamo"}]}),
        ("POST", "/v1/quotes"): (201, quote_with(OFFER)),
        ("POST", "/v1/deliveries"): (202, {"delivery_id": "dlv_1"}),
    }
    return answering_gateway


def requested(gateway: Gateway, arguments: list[str]) -> Any:
    """The JSON that `skyway quote` sends with these arguments."""
    runner.invoke(make_app(), arguments, catch_exceptions=False)
    return next(body for method, path, body in gateway.calls if path == "/v1/quotes")


def test_an_offer_shows_price_times_provider_expiry_and_the_command_that_accepts_it(
    gateway: Gateway,
) -> None:
    result = runner.invoke(make_app(), ASKED)

    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        "quote quo_1, fleet time 2026-03-02T08:00:00Z",
        "pickup: 120 m to b, 120 m to c",
        "1. 12.50 USD, Alamo (prv_1)",
        "   pickup   2026-03-02T10:00:00Z at a",
        "   arrival  2026-03-02T11:00:00Z  p1 at b, nine of ten by 2026-03-02T11:09:00Z",
        "   expires  2026-03-02T09:00:00Z wall time; its drones and pads are held until then",
        "   accept   skyway accept quo_1 off_1",
    ]
    assert result.stderr == "no offer: prv_2: BUSY, all drones are busy\n"


@pytest.mark.parametrize(
    ("limited_by", "kept"),
    [
        (None, "at most 0.1 % of landings are"),
        ("MOST", "the largest margin, but more than 0.1 % of landings may be"),
    ],
)
def test_an_offer_shows_the_margin_that_follows_from_a_risk(
    gateway: Gateway, limited_by: str | None, kept: str
) -> None:
    risk = {"reserve_risk": 0.001, "flight_margin": 0.2784, "limited_by": limited_by}
    offer = OFFER | {"margins": {"risk": risk | {"from": "a", "to": "b"}}}
    gateway.answers["POST", "/v1/quotes"] = (201, quote_with(offer))

    line = f"   margin   28 % more energy on the flight from a to b: {kept} below the reserve"
    assert line in runner.invoke(make_app(), ASKED).stdout.splitlines()


@pytest.mark.parametrize(("options", "promise"), [([], "P90"), (["--promise", "P50"], "P50")])
def test_the_promise_of_a_request_is_the_p90_unless_an_option_says_otherwise(
    gateway: Gateway, options: list[str], promise: str
) -> None:
    assert requested(gateway, [*ASKED, *options])["qos"]["promise"] == promise


def test_an_offer_that_is_not_held_says_so(gateway: Gateway) -> None:
    gateway.answers["POST", "/v1/quotes"] = (201, quote_with(OFFER | {"is_held": False}))

    assert "wall time; nothing is held" in runner.invoke(make_app(), ASKED).stdout


def test_an_offer_shows_what_it_costs_on_a_shared_trip(gateway: Gateway) -> None:
    pooled = OFFER | {"pooled_price": {"amount": 840, "currency": "USD"}}
    gateway.answers["POST", "/v1/quotes"] = (201, quote_with(pooled))

    shown = runner.invoke(make_app(), ASKED).stdout

    assert "   pooled   8.40 USD if the trip is shared" in shown.splitlines()


def test_a_quote_without_offers_ends_with_exit_code_1_and_says_why(gateway: Gateway) -> None:
    gateway.answers["POST", "/v1/quotes"] = (201, quote_with())

    result = runner.invoke(make_app(), ASKED)

    assert (result.exit_code, result.stdout) == (1, "")
    assert "BUSY" in result.stderr


def test_json_prints_the_answer_of_the_gateway(gateway: Gateway) -> None:
    result = runner.invoke(make_app(), [*ASKED, "--json"])

    assert json.loads(result.stdout) == quote_with(OFFER) | {"offers": [OFFER]}


@pytest.mark.parametrize(("options", "is_held"), [([], None), (["--hold"], True)])
def test_hold_asks_the_gateway_to_hold_the_offers(
    gateway: Gateway, options: list[str], is_held: bool | None
) -> None:
    assert requested(gateway, [*ASKED, *options]).get("hold") is is_held


def test_accepting_an_offer_sends_its_ids_and_prints_the_delivery(gateway: Gateway) -> None:
    result = runner.invoke(make_app(), ["accept", "quo_1", "off_1"])

    assert (result.exit_code, result.stdout) == (0, "dlv_1\n")
    sent = {"quote_id": "quo_1", "offer_id": "off_1"}
    assert gateway.calls == [("POST", "/v1/deliveries", sent)]


def test_a_lost_offer_ends_with_exit_code_1_and_the_gateways_words(gateway: Gateway) -> None:
    lost = {"code": "OFFER_LOST", "detail": "offer off_1 cannot be kept: the pad is gone"}
    gateway.answers["POST", "/v1/deliveries"] = (409, lost)

    result = runner.invoke(make_app(), ["accept", "quo_1", "off_1"])

    assert result.exit_code == 1
    assert "offer off_1 cannot be kept: the pad is gone" in result.stderr


def test_a_quote_shows_how_far_the_stations_near_a_place_are(gateway: Gateway) -> None:
    assert "pickup: 120 m to b, 120 m to c" in runner.invoke(make_app(), ASKED).stdout


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("san-marcos", {"station_id": "san-marcos"}),
        ("29.88,-97.94", {"location": {"latitude": 29.88, "longitude": -97.94}}),
        ("-12, 7.5", {"location": {"latitude": -12.0, "longitude": 7.5}}),
        ("76X4V3M5+8C", {"plus_code": "76X4V3M5+8C"}),
        ("V3M5+8C San Marcos", {"plus_code": "V3M5+8C San Marcos"}),
        ("12 Main Street, San Marcos", {"address": "12 Main Street, San Marcos"}),
        ("Gate A=B", {"address": "Gate A=B"}),
    ],
)
def test_the_form_of_a_place_says_what_it_is(
    gateway: Gateway, text: str, place: dict[str, Any]
) -> None:
    sent = requested(gateway, ["quote", "-p", f"{text}=0.8", "--", text])

    assert sent["pickup"] == place
    [package] = sent["packages"]
    assert (package["destination"], package["mass_kg"]) == (place, 0.8)


def test_the_window_of_the_pickup_is_sent(gateway: Gateway) -> None:
    earliest = ["--earliest-pickup", "2026-03-02T10:00:00Z"]
    sent = requested(gateway, [*ASKED, *earliest, "--latest-pickup", "2026-03-02T12:00:00+01:00"])

    assert sent["earliest_pickup_at"] == "2026-03-02T10:00:00+00:00"
    assert sent["latest_pickup_at"] == "2026-03-02T12:00:00+01:00"


def test_a_hand_over_window_without_a_station_is_for_every_package(gateway: Gateway) -> None:
    sent = requested(gateway, [*ASKED, "--not-before", "2026-03-02T10:00:00Z"])

    openings = [package["not_before_at"] for package in sent["packages"]]
    assert openings == ["2026-03-02T10:00:00+00:00"] * 2


def test_a_hand_over_window_with_a_station_is_for_the_packages_that_go_there(
    gateway: Gateway,
) -> None:
    sent = requested(gateway, [*ASKED, "--latest", "c=2026-03-02T10:00:00Z"])

    ends = [package.get("latest_at") for package in sent["packages"]]
    assert ends == [None, "2026-03-02T10:00:00+00:00"]


@pytest.mark.parametrize(
    ("text", "moment"),
    [
        ("+2h30m", "2026-03-02T10:30:00+00:00"),
        ("+1d", "2026-03-03T08:00:00+00:00"),
        ("+90s", "2026-03-02T08:01:30+00:00"),
    ],
)
def test_a_time_from_now_counts_from_the_fleet_time(
    gateway: Gateway, text: str, moment: str
) -> None:
    assert requested(gateway, [*ASKED, "--latest-pickup", text])["latest_pickup_at"] == moment


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--latest-pickup", "noon"], "--latest-pickup noon: not a moment"),
        (["--latest-pickup", "+3"], "--latest-pickup +3: not a moment"),
        (["--latest-pickup", "+"], "--latest-pickup +: not a moment"),
        (["--not-before", "b=2026-03-02T10:00"], "--not-before 2026-03-02T10:00: the time zone"),
        (["--latest", "x=+1h"], "--latest x=+1h: no --package goes to 'x'"),
    ],
)
def test_a_wrong_moment_is_refused_by_the_name_of_its_option(
    gateway: Gateway, options: list[str], message: str
) -> None:
    result = runner.invoke(make_app(), [*ASKED, *options])

    assert result.exit_code == 1
    assert message in result.stderr
    assert gateway.called == []


def test_a_limit_that_the_gateway_names_is_printed_with_the_option(gateway: Gateway) -> None:
    detail = "10:00 is before packages.1.not_before_at 11:00"
    error = {"field": "packages.0.latest_at", "detail": detail}
    gateway.answers["POST", "/v1/quotes"] = (422, {"detail": "wrong", "errors": [error]})

    result = runner.invoke(make_app(), [*ASKED, "--latest", "+2h"])

    assert "--latest: 10:00 is before --not-before 11:00" in result.stderr


def test_an_unknown_priority_is_refused_with_those_that_exist(gateway: Gateway) -> None:
    result = runner.invoke(make_app(), [*ASKED, "--priority", "LOW"])

    assert result.exit_code == 2
    assert "PRIORITY" in result.stderr
    assert gateway.called == []


@pytest.mark.parametrize(
    ("options", "allowed"),
    [
        ([], {}),
        (["--may-be-later-s", "1800"], {"may_be_later_s": 1800.0}),
        (["--firm-within-s", "600"], {"firm_within_s": 600.0}),
        (["--may-change-provider"], {"may_change_provider": True}),
        (["--pooling"], {"pooling": True, "pooling_wait_s": 0.0}),
        (["--pooling", "--pooling-wait-s", "600"], {"pooling": True, "pooling_wait_s": 600.0}),
    ],
)
def test_a_customer_may_allow_shared_trips_and_later_deliveries(
    gateway: Gateway, options: list[str], allowed: dict[str, Any]
) -> None:
    usual = requested(gateway, ASKED)["qos"]
    gateway.calls.clear()

    qos = requested(gateway, [*ASKED, *options])["qos"]

    assert qos == usual | allowed


def test_a_wait_for_others_needs_a_trip_that_may_be_shared(gateway: Gateway) -> None:
    alone = runner.invoke(make_app(), [*ASKED, "--pooling-wait-s", "600"])
    too_long = runner.invoke(make_app(), [*ASKED, "--pooling", "--pooling-wait-s", "3601"])
    too_late = runner.invoke(make_app(), [*ASKED, "--may-be-later-s", "14401"])

    assert (alone.exit_code, alone.stderr) == (1, "--pooling-wait-s needs --pooling\n")
    never_firm = runner.invoke(make_app(), [*ASKED, "--firm-within-s", "3601"])
    assert (too_long.exit_code, too_late.exit_code, never_firm.exit_code) == (2, 2, 2)
    assert gateway.calls == []


def test_a_file_is_sent_as_it_is(gateway: Gateway, tmp_path: Path) -> None:
    file = tmp_path / "request.json"
    file.write_text('{"pickup": {"station_id": "a"}}')

    sent = requested(gateway, ["quote", "--file", str(file), "--hold"])

    assert sent == {"pickup": {"station_id": "a"}, "hold": True}


@pytest.mark.parametrize("others", [["a"], ["-p", "b=1"], ["--latest", "+1h"], ["--pooling"]])
def test_a_file_excludes_the_options_that_it_replaces(
    gateway: Gateway, tmp_path: Path, others: list[str]
) -> None:
    result = runner.invoke(make_app(), ["quote", *others, "--file", str(tmp_path / "r.json")])

    assert result.exit_code == 1
    assert "--file excludes" in result.stderr
    assert gateway.called == []


@pytest.mark.parametrize("text", ["{", "[]"])
def test_a_file_without_a_json_object_is_refused(
    gateway: Gateway, tmp_path: Path, text: str
) -> None:
    file = tmp_path / "request.json"
    file.write_text(text)

    result = runner.invoke(make_app(), ["quote", "--file", str(file)])

    assert result.exit_code == 1
    assert f"--file {file}: " in result.stderr
    assert gateway.called == []


def test_the_terminal_obeys_nothing_in_the_name_of_a_provider(gateway: Gateway) -> None:
    named = {"provider_id": "prv_1", "name": "Alamo\x1b[2J\r\nAccepted"}
    gateway.answers[("GET", "/v1/providers")] = (200, {"items": [named]})

    shown = runner.invoke(make_app(), ASKED, catch_exceptions=False).output

    assert "\x1b" not in shown
    assert "\r" not in shown
    assert "Alamo [2J Accepted (prv_1)" in shown
