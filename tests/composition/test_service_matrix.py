"""Every call of composition without the right secret, made from its OpenAPI document."""

from typing import Any

import pytest

from tests.service_matrix import guarded_calls

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
CALLS = list(guarded_calls("composition"))
#: What the registry asks of composition.
OF_REGISTRY = {
    "/internal/station-checks",
    "/internal/networks/1/stations",
    "/internal/renewed-credentials",
    "/internal/drone-alarms",
    "/internal/business-faults",
}


async def test_only_services_get_in_and_each_only_to_what_is_for_it(
    composition: Any, subtests: pytest.Subtests
) -> None:
    async def status(call: tuple[str, str, Any], secret: str, caller: str | None = None) -> int:
        bearer = {"Authorization": f"Bearer {secret}"}
        answer = await composition(caller, *call, **bearer)
        return int(answer.status_code)

    for call in CALLS:
        method, path, _ = call
        with subtests.test(f"{method} {path}"):
            assert await status(call, "nobody") == 401
            assert await status(call, "secret of composition") == 401
            assert await status(call, "secret of registry", "operator:x") == 403
            assert (await status(call, "secret of registry") != 403) == (path in OF_REGISTRY)
