"""Composition asks which drones may not begin a mission."""

from typing import Any


async def ask(api: Any, *drone_ids: str) -> list[str]:
    answer = await api(
        None,
        "POST",
        "/internal/drones-out-of-service",
        {"drone_ids": drone_ids},
        service="composition",
    )
    assert answer.status_code == 200, answer.text
    found: list[str] = answer.json()["drone_ids"]
    return found


async def test_maintenance_suspension_and_removal_take_drones_out_of_service(api: Any) -> None:
    provider, suspended = await api.provider(), await api.provider(name="Other")
    kept, resting, removed = [(await api.drone(provider))["drone_id"] for _ in range(3)]
    grounded = (await api.drone(suspended))["drone_id"]
    drones = (kept, resting, removed, grounded)
    assert await ask(api, *drones) == []

    path = f"/v1/providers/{provider}/drones"
    await api(f"provider:{provider}", "PATCH", f"{path}/{resting}", {"state": "MAINTENANCE"})
    await api(f"provider:{provider}", "DELETE", f"{path}/{removed}")
    await api("operator:op", "PATCH", f"/v1/providers/{suspended}", {"state": "SUSPENDED"})

    assert await ask(api, *drones) == [resting, removed, grounded]
    await api(f"provider:{provider}", "PATCH", f"{path}/{resting}", {"state": "AVAILABLE"})
    assert await ask(api, *drones) == [removed, grounded]


async def test_a_question_about_too_many_drones_is_refused(api: Any) -> None:
    answer = await api(
        None,
        "POST",
        "/internal/drones-out-of-service",
        {"drone_ids": [f"drn_{number}" for number in range(1_001)]},
        service="composition",
    )

    assert answer.status_code == 422
