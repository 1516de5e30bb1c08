"""`skyway recipient`: a person who looks at the tracking page, types the PIN, or signs."""

from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

PAGE = "/track/dlv_1/token"


def shown(state: str, method: str = "PIN", **members: Any) -> dict[str, Any]:
    """What the page shows of a delivery with one package."""
    proof = {"method": method, "pin": "4711" if method == "PIN" else None, "given_at": None}
    package = {"package_id": "p1", "state": state, "proof_until_at": None, "dropoff_proof": proof}
    return {"packages": [{**package, **members}]}


class Pages(dict[tuple[str, str], tuple[int, Any]]):
    """The answers of a gateway whose page shows one state after the other."""

    def __init__(self, *states: dict[str, Any], proof: tuple[int, Any]) -> None:
        super().__init__({("POST", f"{PAGE}/proof"): proof})
        self._states = [*states]

    def get(self, key: tuple[str, str], default: Any = None) -> Any:
        if key != ("GET", f"{PAGE}/state"):
            return super().get(key, default)
        # The gateway looks twice for each call: with the query, and without it.
        is_last_look = self._looks % 2 == 1
        self._looks += 1
        return 200, self._states.pop(0) if is_last_look else self._states[0]

    _looks = 0


def run(gateway: Gateway, *options: str) -> Any:
    url = f"http://127.0.0.1:{gateway.server_port}{PAGE}"
    return CliRunner().invoke(make_app(), ["recipient", url, "--every-s", "0.01", *options])


def proofs_sent(gateway: Gateway) -> list[Any]:
    return [body for method, _, body in gateway.calls if method == "POST"]


@pytest.mark.parametrize(
    ("method", "options", "given"),
    [
        ("PIN", (), {"pin": "4711"}),
        ("PIN", ("--wrong",), {"pin": "0"}),
        ("SIGNATURE", ("--name", "Ada"), {"signature": {"name": "Ada"}}),
        ("SIGNATURE", ("--absent",), None),
        ("PHOTO", (), None),
    ],
)
def test_a_recipient_gives_the_proof_while_the_drone_waits(
    answering_gateway: Gateway, method: str, options: tuple[str, ...], given: Any
) -> None:
    waiting = shown("IN_TRANSIT", method, proof_until_at="2026-03-02T08:35:00Z")
    states = shown("LOADED", method), waiting, shown("DELIVERED", method)
    answering_gateway.answers = Pages(*states, proof=(204, b""))

    result = run(answering_gateway, *options)

    assert result.exit_code == 0, result.output
    expected = [] if given is None else [{"package_id": "p1", **given}]
    assert proofs_sent(answering_gateway) == expected
    lines = result.output.splitlines()
    assert lines[0] == "p1: LOADED"
    assert f"p1: the drone waits for a {method} until 2026-03-02T08:35:00Z" in lines
    assert lines[-1] == "p1: DELIVERED"


def test_a_refused_proof_is_said_and_the_recipient_goes_on(answering_gateway: Gateway) -> None:
    waiting = shown("IN_TRANSIT", proof_until_at="2026-03-02T08:35:00Z")
    refused = 422, {"detail": "pin: is wrong; 4 of 5 tries are left"}
    answering_gateway.answers = Pages(waiting, shown("RETURNED"), proof=refused)

    result = run(answering_gateway, "--wrong")

    assert result.exit_code == 0, result.output
    assert "p1: PIN refused: pin: is wrong; 4 of 5 tries are left" in result.output


def test_a_link_that_does_not_work_ends_the_command(answering_gateway: Gateway) -> None:
    result = run(answering_gateway)

    assert result.exit_code == 1
    assert "was answered 404: no route" in result.output
