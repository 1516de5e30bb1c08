"""The forms of a registration: one item or a list of items, registered or only checked."""

from typing import Annotated, Any, Final, TypeVar

from pydantic import Discriminator, Field, Tag

from skyway.contracts.drones import MOST_NEW_DRONES
from skyway.json_model import QueryModel

ItemT = TypeVar("ItemT")


def _form_of(body: object) -> str:
    return "list" if isinstance(body, list) else "object"


#: One item, or up to 500 in one call; complaints are about the given form alone.
OneOrMany = Annotated[
    Annotated[ItemT, Tag("object")]
    | Annotated[
        list[ItemT],
        Field(min_length=1, max_length=MOST_NEW_DRONES, fail_fast=True),
        Tag("list"),
    ],
    Discriminator(_form_of),
]


class DryRun(QueryModel):
    """Whether to register, or only to check."""

    dry_run: Annotated[
        bool, Field(description="Check everything and register nothing; the answer is 204.")
    ] = False


#: The answer to a dry run that finds no fault; of any JSON.
GOOD_DRY_RUN: Final[dict[int | str, dict[str, Any]]] = {
    204: {"description": "A dry run has found no fault."}
}
