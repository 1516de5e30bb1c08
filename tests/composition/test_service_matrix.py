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
    "/internal/cell-work",
}


@pytest.mark.parametrize(("method", "path", "body"), CALLS, ids=lambda each: str(each)[:60])
async def test_only_services_get_in_and_each_only_to_what_is_for_it(
    composition: Any, method: str, path: str, body: Any
) -> None:
    async def status(secret: str, caller: str | None = None) -> int:
        bearer = {"Authorization": f"Bearer {secret}"}
        answer = await composition(caller, method, path, body, **bearer)
        return int(answer.status_code)

    assert await status("nobody") == await status("secret of composition") == 401
    assert await status("secret of registry", "operator:x") == 403
    assert (await status("secret of registry") != 403) == (path in OF_REGISTRY)
