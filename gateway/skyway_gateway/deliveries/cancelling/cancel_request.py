"""What a customer asks to cancel, and the packages that this means."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from skyway.errors import InvalidInput
from skyway.ids import PackageId
from skyway.json_model import JsonModel
from skyway.runtime.errors import Conflict
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus


class CancelRequest(JsonModel):
    """What is to be cancelled: the whole delivery, or these packages; and why."""

    package_ids: Annotated[
        Annotated[tuple[PackageId, ...], Field(min_length=1)] | None,
        Field(description="The packages to cancel; without them, the whole delivery."),
    ] = None
    reason: Annotated[
        Annotated[str, Field(max_length=500)] | None,
        Field(description="Why, at most 500 characters; events and packages show it."),
    ] = None


def requested_packages(delivery: Delivery, requested: CancelRequest) -> list[PackageStatus]:
    """The packages that a customer asks to cancel, in the order of the request.

    Raises
    ------
    InvalidInput
        The delivery has no such package.
    """
    if requested.package_ids is None:
        return list(delivery.packages)
    packages = {package.package_id: package for package in delivery.packages}
    for number, package_id in enumerate(requested.package_ids):
        if package_id not in packages:
            field = f"package_ids.{number}"
            raise InvalidInput(field, f"delivery {delivery.delivery_id} has no {package_id!r}")
    return [packages[package_id] for package_id in requested.package_ids]


def too_late(packages: Sequence[PackageStatus]) -> Conflict:
    """The error when none of these packages can be stopped."""
    states = ", ".join(f"{package.package_id} is {package.state}" for package in packages[:5])
    return Conflict("TOO_LATE", f"nothing can be stopped any more: {states}")
