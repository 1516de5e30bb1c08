"""Every call of the registry without the right secret, made from its OpenAPI document."""

from typing import Any

import pytest

from tests.service_matrix import guarded_calls

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
CALLS = list(guarded_calls("provider-registry"))
#: What composition asks of the registry.
OF_COMPOSITION = {
    "/internal/candidate-lists",
    "/internal/mission-reports",
    "/internal/mission-reports/many",
    "/internal/drones-out-of-service",
    "/internal/exchanging-providers",
    "/internal/drone-signatures",
    "/internal/networks/1/drones",
}


async def test_only_services_get_in_and_each_only_to_what_is_for_it(
    api: Any, subtests: pytest.Subtests
) -> None:
    for method, path, body in CALLS:
        with subtests.test(f"{method} {path}"):
            unknown = await api.client.request(
                method, path, json=body, headers={"Authorization": "Bearer unknown"}
            )
            uninvited = await api(None, method, path, body, service="registry")
            composition = await api(None, method, path, body, service="composition")
            pretended = await api("operator:x", method, path, body, service="composition")

            assert unknown.status_code == uninvited.status_code == 401
            assert pretended.status_code == 403
            assert (composition.status_code != 403) == (path in OF_COMPOSITION)
