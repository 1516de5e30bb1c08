"""`skyway recipient`: a person who follows tracking pages, and proves hand-overs."""

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from skyway.cli.gateway import fail, http, problem_of

if TYPE_CHECKING:
    import httpx

#: Wall seconds for an answer.
_TIMEOUT_S: Final = 30.0

#: A package in one of these states is on its way, or will be.
_OPEN: Final = ("CREATED", "LOADED", "IN_TRANSIT", "RETURNING")

_UrlsArgument = Annotated[
    list[str], typer.Argument(metavar="TRACKING_URL...", help="Links to tracking pages.")
]
_WrongOption = Annotated[
    bool, typer.Option("--wrong", help="Type a wrong PIN whenever one is asked for.")
]
_AbsentOption = Annotated[
    bool, typer.Option("--absent", help="Only look: type and sign nothing, as if nobody was there.")
]
_NameOption = Annotated[str, typer.Option(help="The name to sign with.")]
_EveryOption = Annotated[
    float, typer.Option(min=0.01, max=3600.0, help="Seconds between two looks at a page.")
]

#: What a person gives for a proof, JSON of a tracking page; None for nothing.
Deed = Callable[[dict[str, Any]], dict[str, Any] | None]


def recipient_command(
    tracking_urls: _UrlsArgument,
    wrong: _WrongOption = False,
    absent: _AbsentOption = False,
    name: _NameOption = "A. Recipient",
    every_s: _EveryOption = 1.0,
) -> None:
    """Follow tracking pages like a recipient, and prove each hand-over of a drone.

    Types the PIN that the page shows, or signs. Ends when no package is on its way any more.
    """

    def deed(proof: dict[str, Any]) -> dict[str, Any] | None:
        if absent or proof["method"] == "PHOTO":  # the drone takes the picture
            return None
        if proof["method"] == "SIGNATURE":
            return {"signature": {"name": name}}
        if wrong:
            return {"pin": "1" if proof["pin"] == "0" else "0"}
        return {"pin": proof["pin"]} if proof["pin"] else None

    waiting, said = [*tracking_urls], set[str]()
    while waiting:
        for url in [*waiting]:
            packages = _ask("GET", f"{url}/state").json()["packages"]
            for line in [line for each in packages for line in _meet(url, each, deed)]:
                if line not in said:
                    said.add(line)
                    typer.echo(line)
            if not any(each["state"] in _OPEN for each in packages):
                waiting.remove(url)
        if waiting:
            time.sleep(every_s)


def _meet(url: str, package: dict[str, Any], deed: Deed) -> Iterator[str]:
    """Do what the person does about a package, JSON of a tracking page; yields what happens."""
    name, until_at = package["package_id"], package["proof_until_at"]
    yield f"{name}: {package['state']}"
    proof = package["dropoff_proof"]
    if until_at is None or proof is None or proof["given_at"] is not None:
        return
    yield f"{name}: the drone waits for a {proof['method']} until {until_at}"
    given = deed(proof)
    if given is not None:
        answer = _ask("POST", f"{url}/proof", {"package_id": name, **given})
        done = "given" if answer.is_success else f"refused: {problem_of(answer)}"
        yield f"{name}: {proof['method']} {done}"


def _ask(method: str, url: str, body: dict[str, Any] | None = None) -> "httpx.Response":
    """What the gateway answers; only a proof may be refused."""
    import httpx

    try:
        answer = http().request(method, url, json=body, timeout=_TIMEOUT_S)
    except (httpx.TransportError, httpx.InvalidURL, httpx.UnsupportedProtocol) as error:
        fail(f"no answer from {url}: {error}")
    if method == "GET" and not answer.is_success:
        fail(f"{url} was answered {answer.status_code}: {problem_of(answer)}")
    return answer
