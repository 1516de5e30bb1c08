"""`skyway sandbox`: makes a test key with the customer's key."""

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway


def test_a_test_key_is_made_with_the_customers_key(
    answering_gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SKYWAY_CUSTOMER_KEY", "sk_live_shop")
    answering_gateway.answers["POST", "/v1/keys"] = (201, {"key": "sk_test_1"})

    result = CliRunner().invoke(make_app(), ["sandbox", "--name", "ci"])

    assert result.stdout == "sk_test_1\n"
    assert answering_gateway.calls == [("POST", "/v1/keys", {"livemode": False, "name": "ci"})]
    assert answering_gateway.keys == ["sk_live_shop"]
