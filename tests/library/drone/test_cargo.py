"""Which packages a drone has room for, and may carry."""

from typing import Any

import pytest
from pydantic import ValidationError

from skyway.delivery.request import Package
from skyway.drone.cargo import CargoBay, SizeMm, misfit
from skyway.drone.models import PAPER_SCENARIO


def package(name: str = "p1", size: tuple[int, int, int] | None = None, **needs: Any) -> Package:
    members = {"package_id": name, "mass_kg": 0.1, "destination": {"station_id": "a"}, **needs}
    if size is not None:
        members["size_mm"] = dict(zip(("length", "width", "height"), size, strict=True))
    return Package.model_validate(members)


def bay(*size: int, **abilities: Any) -> CargoBay:
    box = dict(zip(("length", "width", "height"), size, strict=True)) if size else None
    return CargoBay.model_validate({"cargo_mm": box, **abilities})


@pytest.mark.parametrize(
    ("box", "packages", "fits"),
    [
        ((400, 300, 200), [(400, 300, 200)], True),
        ((400, 300, 200), [(401, 300, 200)], False),
        ((400, 300, 200), [(200, 400, 300)], True),  # tilted
        ((400, 300, 200), [(200, 300, 200)] * 2, True),
        ((400, 300, 200), [(200, 150, 200)] * 4, True),  # two rows of two
        ((400, 300, 200), [(200, 150, 200)] * 5, False),
        ((400, 300, 200), [(200, 150, 200)] * 3 + [(201, 150, 200)], False),
        ((400, 300, 200), [(390, 290, 90)] * 2, False),  # nothing stands on a package
        ((300, 400, 200), [(200, 150, 200)] * 4, True),
        ((), [(10_000, 10_000, 10_000)], True),  # a model without a box
        ((1, 1, 1), [None], True),  # a package without a size
    ],
)
def test_packages_fit_if_they_stand_side_by_side(
    box: tuple[int, ...], packages: list[tuple[int, int, int] | None], fits: bool
) -> None:
    found = misfit(bay(*box), [package(f"p{n}", size) for n, size in enumerate(packages)])

    assert (found is None) is fits
    assert found is None or found.code == "TOO_LARGE"


def test_a_package_that_stays_upright_is_not_tilted() -> None:
    box = bay(400, 300, 200)

    assert misfit(box, [package(size=(100, 100, 300))]) is None
    found = misfit(box, [package(size=(100, 100, 300), handling=["UPRIGHT"])])
    assert found is not None
    assert "'p1' does not fit into the cargo box of 400x300x200 mm" in found.detail


@pytest.mark.parametrize(
    ("needs", "abilities", "fits"),
    [
        ({"handling": ["FRAGILE", "UPRIGHT"]}, {}, True),
        ({"handling": ["COLD"]}, {}, False),
        ({"handling": ["COLD"]}, {"carries": ["COLD"]}, True),
        ({"handling": ["FRAGILE"]}, {"carries": []}, False),
        ({"handling": ["DANGEROUS"], "dangerous_class": "9"}, {"carries": ["DANGEROUS"]}, False),
        (
            {"handling": ["DANGEROUS"], "dangerous_class": "6.2"},
            {"carries": ["DANGEROUS"], "dangerous_classes": ["6"]},
            True,
        ),
        (
            {"handling": ["DANGEROUS"], "dangerous_class": "6.2"},
            {"carries": ["DANGEROUS"], "dangerous_classes": ["6.1", "9"]},
            False,
        ),
    ],
)
def test_a_drone_carries_only_what_its_model_may_handle(
    needs: dict[str, Any], abilities: dict[str, Any], fits: bool
) -> None:
    found = misfit(bay(**abilities), [package(**needs)])

    assert (found is None) is fits
    assert found is None or found.code == "HANDLING"


@pytest.mark.parametrize(
    ("needs", "complaint"),
    [
        ({"handling": ["COLD", "COLD"]}, "COLD is given twice"),
        ({"handling": ["DANGEROUS"]}, "if, and only if, handling has DANGEROUS"),
        ({"dangerous_class": "9"}, "if, and only if, handling has DANGEROUS"),
        ({"handling": ["DANGEROUS"], "dangerous_class": "0"}, "dangerous_class"),
        ({"handling": ["HEAVY"]}, "handling"),
        ({"size_mm": {"length": 0, "width": 1, "height": 1}}, "greater than or equal to 1"),
        ({"size_mm": {"length": 10_001, "width": 1, "height": 1}}, "less than or equal to 10000"),
        ({"size_mm": {"length": 1, "width": 1}}, "height"),
    ],
)
def test_wrong_needs_are_refused_by_name(needs: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        package(**needs)


def test_what_says_nothing_leaves_the_json_as_it_was() -> None:
    assert package().model_dump(mode="json").keys().isdisjoint({"size_mm", "handling"})
    assert PAPER_SCENARIO.model_dump(mode="json").keys().isdisjoint({"cargo_mm", "carries"})
    assert not package().needs_cargo_check


def test_a_size_is_in_millimetres_of_each_side() -> None:
    size = package(size=(1, 2, 3)).size_mm

    assert size == SizeMm(length=1, width=2, height=3)
