"""Providers over REST: permissions, changes, and refusals of bad bodies."""

from typing import Any, get_args

import pytest

from skyway.contracts.candidate import Standby

PAYMENT_TERMS = {"cancellation": {"until_loaded": 0.0, "in_flight": 1.0}, "late": []}
TARIFF = {
    "currency": "USD",
    "base": 300,
    "per_km": 20,
    "per_kg": 0,
    "per_recharge_minute": 0,
    "minimum": 0,
}


async def test_a_registered_provider_reads_like_the_answer(api: Any) -> None:
    body = {"name": "Hill Country Drones", "tariff": TARIFF, "terms": "net 30"}

    made = await api("operator:op", "POST", "/v1/providers", body)

    read = await api("operator:op", "GET", made.headers["location"])
    assert made.status_code == 201
    assert read.json() == made.json()
    assert made.json() == {
        **body,
        "tariff": {
            **TARIFF,
            "priority_factor": 1.5,
            "pooled_factor": 1.0,
            "payment_terms": PAYMENT_TERMS,
        },
        "provider_id": "prv_000001",
        "state": "ACTIVE",
        "loading": "AUTOMATIC",
        "standby": "HOME",
        "exchanges_deliveries": False,
        "created_at": "2026-03-01T12:00:00Z",
    }


async def test_a_provider_says_who_confirms_what_is_loaded_and_changes_it(api: Any) -> None:
    body = {"name": "x", "tariff": {}, "loading": "CONFIRMED"}
    made = await api("operator:op", "POST", "/v1/providers", body)
    provider_id = made.json()["provider_id"]
    path = f"/v1/providers/{provider_id}"

    changed = await api(f"provider:{provider_id}", "PATCH", path, {"loading": "AUTOMATIC"})

    assert made.json()["loading"] == "CONFIRMED"
    assert changed.json()["loading"] == "AUTOMATIC"


@pytest.mark.parametrize("standby", ["PARKING", "NEXT_PICKUP"])
async def test_a_provider_chooses_where_its_idle_drones_go(api: Any, standby: str) -> None:
    body = {"name": "x", "tariff": {}, "standby": "STAY"}
    made = await api("operator:op", "POST", "/v1/providers", body)
    provider_id = made.json()["provider_id"]
    path = f"/v1/providers/{provider_id}"

    changed = await api(f"provider:{provider_id}", "PATCH", path, {"standby": standby})

    assert made.json()["standby"] == "STAY"
    assert changed.json()["standby"] == standby


@pytest.mark.parametrize("standby", ["ROAM", None, 1])
async def test_an_unknown_standby_is_refused_with_its_field_and_the_choices(
    api: Any, standby: object
) -> None:
    provider_id = await api.provider()

    answer = await api(
        f"provider:{provider_id}", "PATCH", f"/v1/providers/{provider_id}", {"standby": standby}
    )

    (problem,) = answer.json()["errors"]
    assert (answer.status_code, problem["field"]) == (422, "standby")
    if standby is not None:
        assert all(choice in problem["detail"] for choice in get_args(Standby))


@pytest.mark.parametrize("caller", ["provider:prv_1", "customer:c", "drone:drn_1", None])
async def test_only_operators_register_providers(api: Any, caller: str | None) -> None:
    answer = await api(caller, "POST", "/v1/providers", {"name": "x", "tariff": {}})

    assert answer.status_code == 403


async def test_an_unknown_service_is_refused(api: Any) -> None:
    api.client.headers["Authorization"] = "Bearer guessed"

    answer = await api("operator:op", "GET", "/v1/providers")

    assert answer.status_code == 401


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"name": ""}, "name"),
        ({"name": "x" * 201}, "name"),
        ({"tariff": {"base": -1}}, "tariff.base"),
        ({"tariff": {"currency": "usd"}}, "tariff.currency"),
        ({"tariff": None}, "tariff"),
        ({"terms": "x" * 10_001}, "terms"),
        ({"colour": "red"}, "colour"),
        ({"loading": "NOBODY"}, "loading"),
        ({"standby": "ROAM"}, "standby"),
        ({"state": "ACTIVE"}, "state"),
    ],
)
async def test_a_bad_provider_is_refused_with_its_field(
    api: Any, change: dict[str, object], field: str
) -> None:
    body = {"name": "x", "tariff": {}, **change}

    answer = await api("operator:op", "POST", "/v1/providers", body)

    assert answer.status_code == 422
    assert [problem["field"] for problem in answer.json()["errors"]] == [field]


async def test_the_same_key_registers_one_provider(api: Any) -> None:
    body = {"name": "x", "tariff": {}}

    first = await api("operator:op", "POST", "/v1/providers", body, key="k")
    again = await api("operator:op", "POST", "/v1/providers", body, key="k")
    other = await api("operator:op", "POST", "/v1/providers", {**body, "name": "y"}, key="k")

    listed = await api("operator:op", "GET", "/v1/providers")
    assert again.json() == first.json()
    assert other.status_code == 422
    assert len(listed.json()["items"]) == 1


async def test_a_provider_sees_only_itself(api: Any) -> None:
    mine, other = await api.provider(), await api.provider()

    listed = await api(f"provider:{mine}", "GET", "/v1/providers")
    own = await api(f"provider:{mine}", "GET", f"/v1/providers/{mine}")
    foreign = await api(f"provider:{mine}", "GET", f"/v1/providers/{other}")

    assert [item["provider_id"] for item in listed.json()["items"]] == [mine]
    assert own.status_code == 200
    assert foreign.status_code == 404


async def test_a_provider_changes_only_itself(api: Any) -> None:
    mine, other = await api.provider(), await api.provider()

    foreign = await api(f"provider:{mine}", "PATCH", f"/v1/providers/{other}", {"name": "mine"})

    untouched = await api("operator:op", "GET", f"/v1/providers/{other}")
    assert foreign.status_code == 404
    assert untouched.json()["name"] == "Hill Country Drones"


async def test_operators_see_all_and_customers_see_names_and_tariffs(api: Any) -> None:
    provider_id = await api.provider(terms="secret terms")

    whole = await api("operator:op", "GET", "/v1/providers")
    cards = await api("customer:c", "GET", "/v1/providers")
    card = await api("customer:c", "GET", f"/v1/providers/{provider_id}")

    assert whole.json()["items"][0]["terms"] == "secret terms"
    assert set(cards.json()["items"][0]) == {"provider_id", "name", "tariff"}
    assert card.json() == cards.json()["items"][0]


OTHER_TARIFF = {
    "currency": "EUR",
    "base": 450,
    "per_km": 30,
    "per_kg": 100,
    "per_recharge_minute": 5,
    "minimum": 600,
    "priority_factor": 2.0,
    "pooled_factor": 0.5,
    "payment_terms": PAYMENT_TERMS,
}
LATE = {**PAYMENT_TERMS, "late": [{"after_min": 15, "share": 0.1}]}
CHANGED_TARIFF = dict.fromkeys(OTHER_TARIFF, 1) | {"currency": "USD", "payment_terms": LATE}


@pytest.mark.databases("sqlite")
@pytest.mark.parametrize("name", OTHER_TARIFF)
async def test_a_change_of_one_member_of_a_tariff_keeps_all_others(api: Any, name: str) -> None:
    provider_id = await api.provider(terms="old", tariff=OTHER_TARIFF)
    path = f"/v1/providers/{provider_id}"
    before = (await api("operator:op", "GET", path)).json()
    change = {name: CHANGED_TARIFF[name]}

    answer = await api(f"provider:{provider_id}", "PATCH", path, {"tariff": change})

    assert answer.json() == {**before, "tariff": {**OTHER_TARIFF, **change}}
    assert (await api("operator:op", "GET", path)).json() == answer.json()


async def test_a_change_within_payment_terms_keeps_their_other_members(api: Any) -> None:
    terms = {"cancellation": {"until_loaded": 0.2, "in_flight": 0.5}, "late": LATE["late"]}
    path = f"/v1/providers/{await api.provider(tariff={**OTHER_TARIFF, 'payment_terms': terms})}"

    async def changed(cancellation: dict[str, float]) -> Any:
        change = {"tariff": {"payment_terms": {"cancellation": cancellation}}}
        return await api("operator:op", "PATCH", path, change)

    lower, higher = await changed({"in_flight": 0.4}), await changed({"until_loaded": 0.45})

    cancellation = {"until_loaded": 0.2, "in_flight": 0.4}
    assert lower.json()["tariff"]["payment_terms"] == {**terms, "cancellation": cancellation}
    [error] = higher.json()["errors"]
    assert (higher.status_code, error["field"]) == (422, "tariff.payment_terms.cancellation")
    assert "in_flight 0.4 must not be below until_loaded 0.45" in error["detail"]


async def test_a_tariff_or_a_member_of_it_cannot_be_null(api: Any) -> None:
    path = f"/v1/providers/{await api.provider(tariff=OTHER_TARIFF)}"

    for tariff, field in ((None, "tariff"), ({"base": None}, "tariff.base")):
        answer = await api("operator:op", "PATCH", path, {"tariff": tariff})

        assert answer.status_code == 422
        assert answer.json()["errors"][0]["field"] == field
    assert (await api("operator:op", "GET", path)).json()["tariff"] == OTHER_TARIFF


async def test_terms_can_be_removed_and_a_name_cannot(api: Any) -> None:
    provider_id = await api.provider(terms="old")
    path = f"/v1/providers/{provider_id}"

    without_terms = await api("operator:op", "PATCH", path, {"terms": None})
    without_name = await api("operator:op", "PATCH", path, {"name": None})

    assert without_terms.json()["terms"] is None
    assert without_name.status_code == 422
    assert without_name.json()["errors"][0]["field"] == "name"


async def test_only_operators_suspend_a_provider(api: Any) -> None:
    provider_id = await api.provider()
    path = f"/v1/providers/{provider_id}"

    by_itself = await api(f"provider:{provider_id}", "PATCH", path, {"state": "SUSPENDED"})
    by_operator = await api("operator:op", "PATCH", path, {"state": "SUSPENDED"})

    assert by_itself.status_code == 403
    assert by_operator.json()["state"] == "SUSPENDED"


async def test_a_long_list_comes_in_pages(api: Any) -> None:
    made = [await api.provider() for _ in range(5)]

    first = (await api("operator:op", "GET", "/v1/providers?limit=3")).json()
    rest = (
        await api("operator:op", "GET", f"/v1/providers?limit=3&cursor={first['next_cursor']}")
    ).json()

    seen = [item["provider_id"] for item in first["items"] + rest["items"]]
    assert seen == made
    assert rest["next_cursor"] is None


async def test_a_foreign_cursor_is_refused(api: Any) -> None:
    answer = await api("operator:op", "GET", "/v1/providers?cursor=nonsense")

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "cursor"
