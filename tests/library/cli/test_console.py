"""`skyway console`: prints a link that logs a browser in."""

from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

URL = "http://gateway/console#login=abc"


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    link = {"url": URL, "expires_wall_at": "2026-03-01T12:10:00Z"}
    answering_gateway.answers["POST", "/v1/session-links"] = (201, link)
    return answering_gateway


def run(*arguments: str) -> Any:
    return CliRunner().invoke(make_app(), ["console", *arguments])


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ((), "SKYWAY_OPERATOR_KEY"),
        (("--role", "customer"), "SKYWAY_CUSTOMER_KEY"),
        (("--role", "provider"), "SKYWAY_PROVIDER_KEY"),
    ],
)
def test_the_link_is_made_with_the_key_of_the_role(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], key: str
) -> None:
    monkeypatch.setenv(key, "sk_of_the_role")

    result = run(*arguments)

    assert result.stdout == f"{URL}\n"
    assert gateway.keys == ["sk_of_the_role"]


def test_a_role_without_a_key_is_refused(gateway: Gateway) -> None:
    result = run("--role", "provider")

    assert result.exit_code == 1
    assert "SKYWAY_PROVIDER_KEY is not set" in result.stderr
