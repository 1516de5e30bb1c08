"""`skyway api`: every route that a provider may call, with the provider's key alone."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

OPENAPI: dict[str, Any] = json.loads(
    (Path(__file__).parents[3] / "openapi/gateway.json").read_text(encoding="utf-8")
)
PROVIDERS = [{"provider_id": "prv_1", "name": "Hill Country Drones"}]
PROVIDER = "/v1/providers/prv_1"
PAGES = "/v1/statements/lines"
CSV_PAGE, LAST_CSV_PAGE = b"line_id,note\r\nl_1,late\r\n", b"line_id,note\r\nl_2,\r\n"


@pytest.fixture
def gateway(answering_gateway: Gateway, monkeypatch: pytest.MonkeyPatch) -> Gateway:
    """A gateway that the environment has the provider's key for."""
    monkeypatch.setenv("SKYWAY_PROVIDER_KEY", "sk_provider")
    answering_gateway.answers |= {
        ("GET", "/v1/providers"): (200, {"items": PROVIDERS, "next_cursor": None}),
        ("PATCH", PROVIDER): (200, {"provider_id": "prv_1", "name": "Ü\x1b[2J"}),
        ("GET", PAGES): (200, {"items": [1], "next_cursor": "a+b"}),
        ("GET", f"{PAGES}?cursor=a%2Bb"): (200, {"items": [2], "next_cursor": None}),
    }
    return answering_gateway


def run(*arguments: str, body: bytes | None = None) -> Any:
    return CliRunner().invoke(make_app(), ["api", *arguments], input=body)


def provider_calls() -> list[tuple[str, str, bool]]:
    """Method, path, and whether a body is needed, of each call whose callers are providers."""
    return [
        (method.upper(), re.sub(r"\{(?!provider)\w+\}", "x", path), "requestBody" in operation)
        for path, operations in OPENAPI["paths"].items()
        for method, operation in operations.items()
        if re.search(r"Callers: [^.]*\bprovider\b", operation.get("description", ""))
    ]


def test_every_call_of_a_provider_is_made_with_its_key_alone(gateway: Gateway) -> None:
    calls = provider_calls()
    for method, path, has_body in calls:
        called = path.replace("{provider_id}", "{provider}")
        sent = path.replace("{provider_id}", "prv_1")
        gateway.answers.setdefault((method, sent), (200, {}))

        result = run(method, called, *(["name=x"] if has_body else []))

        assert result.exit_code == 0, result.stderr
        assert gateway.calls[-1] == (method, sent, {"name": "x"} if has_body else None)
    assert len(calls) > 50
    assert {*gateway.keys} == {"sk_provider"}


def test_fields_are_json_or_texts_and_dots_lead_into_objects(gateway: Gateway) -> None:
    fields = ("tariff.base=300", "tariff.currency=USD", "terms=null", "name=a=b", 'note="7"')

    result = run("patch", "/v1/providers/{provider}", *fields)

    tariff = {"base": 300, "currency": "USD"}
    changed = {"tariff": tariff, "terms": None, "name": "a=b", "note": "7"}
    assert gateway.calls[-1] == ("PATCH", PROVIDER, changed)
    assert json.loads(result.stdout) == {"provider_id": "prv_1", "name": "Ü\x1b[2J"}
    assert "\x1b" not in result.stdout


def test_fields_of_a_get_are_parameters_of_its_query(gateway: Gateway) -> None:
    run("GET", f"{PAGES}?month=2026-03", "from=2026-03-01T00:00:00+01:00", "limit=1")

    assert gateway.queries == ["month=2026-03&from=2026-03-01T00%3A00%3A00%2B01%3A00&limit=1"]


def test_a_body_is_read_from_a_file_or_from_standard_input(
    gateway: Gateway, tmp_path: Path
) -> None:
    (tmp_path / "drones.json").write_bytes(b"[1, 2]")
    gateway.answers["POST", f"{PROVIDER}/drones"] = (201, [1, 2])
    path = "/v1/providers/{provider}/drones"

    from_file = run("POST", path, "--file", str(tmp_path / "drones.json"))
    from_input = run("POST", path, "--file", "-", "--provider", "prv_1", body=b"[3]")

    assert (from_file.exit_code, from_input.exit_code) == (0, 0)
    bodies = [body for method, _, body in gateway.calls if method == "POST"]
    assert bodies == [[1, 2], [3]]


def test_a_list_with_more_pages_says_so_and_all_joins_them(gateway: Gateway) -> None:
    one, every = run("GET", PAGES), run("GET", PAGES, "--all")

    assert json.loads(one.stdout) == {"items": [1], "next_cursor": "a+b"}
    assert one.stderr == "the list has more pages: --all prints them\n"
    assert json.loads(every.stdout) == {"items": [1, 2], "next_cursor": None}
    assert every.stderr == ""


def test_all_pages_of_csv_have_one_row_of_names(gateway: Gateway) -> None:
    link = f'<http://elsewhere{PAGES}?cursor=a%2Bb>; rel="next"'
    gateway.headers |= {
        CSV_PAGE: {"Content-Type": "text/csv", "Link": link},
        LAST_CSV_PAGE: {"Content-Type": "text/csv"},
    }
    gateway.answers["GET", PAGES] = (200, CSV_PAGE)
    gateway.answers["GET", f"{PAGES}?cursor=a%2Bb"] = (200, LAST_CSV_PAGE)

    result = run("GET", PAGES, "--accept", "text/csv", "--all")

    assert result.stdout_bytes == CSV_PAGE + b"l_2,\r\n"


def test_a_refusal_is_printed_with_its_fields(gateway: Gateway) -> None:
    fault = {"field": "tariff.base", "detail": "-1 is below 0"}
    gateway.answers["PATCH", PROVIDER] = (422, {"detail": "the body is wrong", "errors": [fault]})

    result = run("PATCH", PROVIDER, "tariff.base=-1")

    assert result.exit_code == 1
    assert result.stderr.splitlines() == [
        f"PATCH {PROVIDER} was answered 422: the body is wrong",
        "  tariff.base: -1 is below 0",
    ]


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        ("GET @elsewhere/v1", "the path '@elsewhere/v1' does not begin with /"),
        ("GET /v1/zones --provider prv_1", "--provider has no effect: the path has no {provider}"),
        ("DELETE /v1/zones/x --all", "--all is for lists, which are read with GET"),
        (f"GET {PAGES} --file -", "--file is for POST, PUT and PATCH without NAME=VALUE"),
        (f"PATCH {PROVIDER} a=1 --file -", "--file is for POST, PUT and PATCH without NAME=VALUE"),
        (f"PATCH {PROVIDER} a=1 --idempotency-key k", "--idempotency-key is for POST"),
        (f"PATCH {PROVIDER} tariff", "'tariff' is not NAME=VALUE"),
        (f"PATCH {PROVIDER} a..b=1", "'a..b=1' is not NAME=VALUE"),
        (f"PATCH {PROVIDER} a=1 a=2", "a has a value already"),
        (f"PATCH {PROVIDER} a=1 a.b=2", "a.b: a has another value already"),
    ],
)
def test_a_call_that_makes_no_sense_is_not_sent(
    gateway: Gateway, arguments: str, fault: str
) -> None:
    result = run(*arguments.split())

    assert (result.exit_code, result.stderr) == (1, f"{fault}\n")
    assert gateway.calls == []
