"""Which provider a command means, and the names that people gave to drones."""

from collections.abc import Mapping
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import fail, list_items

ProviderOption = Annotated[
    str | None,
    typer.Option(
        "--provider",
        metavar="ID",
        help="The provider, by id or by name; without it, the only one that the key may see.",
    ),
]

#: How many providers a message names, at most.
_NAMED: Final = 5


def provider_path(folder: DataFolder, named: str | None) -> str:
    """The path of the calls about this provider, or about the only one.

    The command ends with a message that lists providers if the name fits none or several.
    """
    if named is not None and named.startswith("prv_"):
        return f"/v1/providers/{quote(named, safe='')}"
    providers = [*list_items(folder, "/v1/providers")]
    found = [one for one in providers if named is None or _is_named(one, named)]
    if not providers:
        fail("no provider is registered")
    if len(found) != 1:
        shown = "\n".join(
            f"  --provider {_words(one['provider_id'], one['name'])}"
            for one in (found or providers)[:_NAMED]
        )
        why = f"{len(found)} providers have this name" if found else f"no provider {named!r}"
        fail(f"{'name the provider' if named is None else why}; for example\n{shown}")
    return f"/v1/providers/{found[0]['provider_id']}"


def drone_words(drone: Mapping[str, Any]) -> str:
    """The id of a drone, and the name that its provider gave to it, if any."""
    return _words(drone["drone_id"], drone["name"])


def drone_labels(folder: DataFolder, provider: str) -> dict[str, str]:
    """`drone_words` of each drone below the path of a provider, by its id."""
    return {
        each["drone_id"]: drone_words(each) for each in list_items(folder, f"{provider}/drones")
    }


def _is_named(provider: Mapping[str, Any], named: str) -> bool:
    return str(provider["name"]).casefold() == named.casefold()


def _words(identifier: str, name: str | None) -> str:
    from skyway.bounds import printable  # other commands start without it

    # Providers choose these names, and this may be somebody else's terminal.
    return identifier if name is None else f"{identifier} ({printable(name)})"
