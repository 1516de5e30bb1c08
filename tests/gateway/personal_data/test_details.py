"""What customers may say about people, and what is refused, with its field and limit."""

from typing import Any

import pytest
from pydantic import ValidationError
from skyway_gateway.deliveries.lifecycle.customer_forms import NewDelivery
from skyway_gateway.personal_data.details import (
    Contact,
    HandOverDetails,
    PackageDetails,
    PersonalData,
    require_packages,
)

from skyway.complaints import fault_of
from skyway.errors import InvalidInput
from skyway.ids import PackageId
from tests.gateway.whole_gateway import make_request

P1, P2 = PackageId("p1"), PackageId("p2")
ANA, BEN = Contact(name="Ana Ruiz"), Contact(name="Ben")


def faults(**given: Any) -> dict[str, str]:
    """The fields at fault of a request with these details."""
    try:
        NewDelivery.model_validate(make_request(**given))
    except ValidationError as error:
        return dict(fault_of(each) for each in error.errors())
    return {}


@pytest.mark.parametrize(
    "given",
    [
        {"recipient": {"name": "Ana"}, "sender": {"name": "River Books", "phone": "+49301234567"}},
        {"recipient": {"name": "سارا‌دخت 李", "email": "a.b+c@mail.example.org"}},
        {"instructions": "Ring twice.\nThe dog is kind."},
        {"metadata": {f"k{number}": "v" * 500 for number in range(50)}},
    ],
    ids=["two contacts", "names of all scripts", "several lines", "50 members of metadata"],
)
def test_what_people_write_is_accepted(given: dict[str, Any]) -> None:
    assert faults(**given) == {}


_LINE = "must be one line of text, without control characters"
_PHONE = "must be a phone number in E.164 form, such as +15125550100"


@pytest.mark.parametrize(
    ("given", "field", "fault"),
    [
        ({"recipient": {"name": "A", "phone": "+1512CALLME0"}}, "recipient.phone", _PHONE),
        ({"recipient": {"name": "A", "phone": "5125550100"}}, "recipient.phone", _PHONE),
        ({"recipient": {"name": "A", "phone": "+1512555٠١٠٠"}}, "recipient.phone", _PHONE),
        ({"recipient": {"name": "A", "phone": "+15125550100\n"}}, "recipient.phone", _PHONE),
        (
            {"sender": {"name": "A", "email": "ana@localhost"}},
            "sender.email",
            "must be an e-mail address, such as ana@example.org",
        ),
        ({"recipient": {"phone": "+15125550100"}}, "recipient.name", "is missing"),
        ({"recipient": {"name": "A\nBcc: b"}}, "recipient.name", _LINE),
        ({"recipient": {"name": "A\x1b[2J"}}, "recipient.name", _LINE),
        ({"recipient": {"name": "A\u202egnp"}}, "recipient.name", _LINE),
        ({"recipient": {"name": "   "}}, "recipient.name", _LINE),
        ({"recipient": {"name": "A" * 101}}, "recipient.name", "must have at most 100 characters"),
        ({"instructions": "A" * 501}, "instructions", "must have at most 500 characters"),
        (
            {"metadata": {f"k{number}": "v" for number in range(51)}},
            "metadata",
            "must have at most 50 items; it has more",
        ),
        ({"metadata": {"k": {"nested": "v"}}}, "metadata.k", "must be text"),
        ({"metadata": {"k": None}}, "metadata.k", "must be text"),
        ({"metadata": {"k": ""}}, "metadata.k", "must have at least 1 characters"),
        ({"metadata": {"k": 5}}, "metadata.k", 'must be text, such as "5"'),
        ({"metadata": {"k": "v" * 501}}, "metadata.k", "must have at most 500 characters"),
        ({"metadata": {"k" * 41: "v"}}, f"metadata.{'k' * 41}.[key]", "must have at most 40 chara"),
        ({"metadata": {"k\r": "v"}}, "metadata.k\r.[key]", _LINE),
        ({"recipient": "Ana"}, "recipient", "must be an object"),
    ],
)
def test_a_wrong_detail_is_named_with_its_limit(
    given: dict[str, Any], field: str, fault: str
) -> None:
    [(found, why)] = faults(**given).items()

    assert found == field
    assert why.startswith(fault)


def test_a_package_has_its_own_details_or_those_of_the_delivery() -> None:
    own = PackageDetails(package_id=P1, recipient=BEN)
    data = PersonalData(recipient=ANA, instructions="Ring.", packages=(own,))

    assert data.of_package(P1) == HandOverDetails(recipient=BEN, instructions="Ring.")
    assert data.of_package(P2) == HandOverDetails(recipient=ANA, instructions="Ring.")


def test_packages_that_say_nothing_are_not_stored() -> None:
    given = PersonalData(metadata={"order": "1042"})
    packages = [PackageDetails(package_id=P1), PackageDetails(package_id=P2, instructions="Ring.")]

    data = PersonalData.of(given, packages)

    assert list(data.by_field()) == ["metadata", "packages.p2.instructions"]


@pytest.mark.parametrize("package_id", ["p3", "p1"], ids=["unknown", "twice"])
def test_a_package_that_is_unknown_or_stands_twice_is_refused(package_id: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        require_packages([P1, PackageId(package_id)], [P1, P2])

    assert refused.value.field == "packages.1.package_id"
