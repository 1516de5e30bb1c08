"""A registration that is only checked."""

from typing import Annotated, Any, Final

from pydantic import Field

from skyway.json_model import QueryModel


class DryRun(QueryModel):
    """Whether to register, or only to check."""

    dry_run: Annotated[
        bool, Field(description="Check everything and register nothing; the answer is 204.")
    ] = False


#: The answer to a dry run that finds no fault; of any JSON.
GOOD_DRY_RUN: Final[dict[int | str, dict[str, Any]]] = {
    204: {"description": "A dry run has found no fault."}
}
