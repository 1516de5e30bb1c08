"""What packages need of a drone besides lift: room in its cargo box, and handling."""

from collections.abc import Iterator, Sequence
from itertools import permutations
from typing import Annotated, Final, Literal, NamedTuple, Protocol, TypeVar

from pydantic import Field, ValidationInfo, field_validator

from skyway.ids import PackageId
from skyway.json_model import JsonModel

Handling = Literal["FRAGILE", "UPRIGHT", "COLD", "DANGEROUS"]

_Millimetres = Annotated[int, Field(ge=1, le=10_000)]

#: A class of the UN's recommendations on the transport of dangerous goods: "9", "6.2".
DangerousClass = Annotated[str, Field(pattern=r"^[1-9](\.[1-6])?$", max_length=3)]

#: What every drone carries whose model says nothing else: nothing stands on a package or tilts it.
_ORDINARY: Final[tuple[Handling, ...]] = ("FRAGILE", "UPRIGHT")

_EachT = TypeVar("_EachT")


class SizeMm(JsonModel):
    """The outer size of a package, or the inner size of a cargo box, in millimetres."""

    length: _Millimetres
    width: _Millimetres
    height: _Millimetres


def _without_repeats(values: tuple[_EachT, ...]) -> tuple[_EachT, ...]:
    for number, value in enumerate(values):
        if value in values[:number]:
            raise ValueError(f"{value} is given twice")
    return values


class CargoNeeds(JsonModel):
    """What a package needs besides lift; a package that says nothing fits every drone."""

    size_mm: Annotated[
        SizeMm | None,
        Field(
            exclude_if=lambda value: value is None,
            description="Outer size in whole millimetres. Without it any cargo box is large "
            "enough.",
        ),
    ] = None
    handling: Annotated[
        tuple[Handling, ...],
        Field(
            max_length=4,
            exclude_if=lambda value: not value,
            description="What its drone must be able to do. UPRIGHT: its height stays vertical.",
        ),
    ] = ()
    dangerous_class: Annotated[
        DangerousClass | None,
        Field(
            exclude_if=lambda value: value is None,
            # After `handling`, which it belongs to.
            validate_default=True,
            description="The UN class of dangerous goods, such as 9 or 6.2; with DANGEROUS only.",
        ),
    ] = None

    _handling_is_given_once = field_validator("handling")(_without_repeats)

    @field_validator("dangerous_class")
    @classmethod
    def _dangerous_goods_have_a_class(cls, value: str | None, info: ValidationInfo) -> str | None:
        if "handling" in info.data and (value is not None) != (
            "DANGEROUS" in info.data["handling"]
        ):
            raise ValueError("must be given if, and only if, handling has DANGEROUS")
        return value

    @property
    def needs_cargo_check(self) -> bool:
        """Whether some drone that lifts the package may not carry it."""
        return self.size_mm is not None or bool(self.handling)


class CargoBay(JsonModel):
    """What a type of drone has room for, and may carry."""

    cargo_mm: Annotated[
        SizeMm | None,
        Field(
            exclude_if=lambda value: value is None,
            description="Inner size of the cargo box in whole millimetres. Without it packages of "
            "any size fit.",
        ),
    ] = None
    carries: Annotated[
        tuple[Handling, ...],
        Field(
            max_length=4,
            exclude_if=lambda value: value == _ORDINARY,
            description="Which handling it can do; packages without handling are always carried.",
        ),
    ] = _ORDINARY
    dangerous_classes: Annotated[
        tuple[DangerousClass, ...],
        Field(
            max_length=30,
            exclude_if=lambda value: not value,
            description="With DANGEROUS the UN classes that it may carry; 6 stands for 6.1 and 6.2 "
            "too.",
        ),
    ] = ()

    _is_given_once = field_validator("carries", "dangerous_classes")(_without_repeats)


class Cargo(Protocol):
    """A package with what it needs."""

    @property
    def package_id(self) -> PackageId:
        """Its id."""

    @property
    def size_mm(self) -> SizeMm | None:
        """Its size, if it is known."""

    @property
    def handling(self) -> tuple[Handling, ...]:
        """What its drone must be able to do."""

    @property
    def dangerous_class(self) -> str | None:
        """The UN class of dangerous goods."""


class Misfit(NamedTuple):
    """Why a drone cannot carry packages that it can lift."""

    code: Literal["TOO_LARGE", "HANDLING"]
    detail: str


def misfit(bay: CargoBay, packages: Sequence[Cargo]) -> Misfit | None:
    """Why a drone with this bay cannot carry the packages together; None if it can.

    Sizes are judged by a simple way to load: packages stand side by side in rows, nothing stands on
    a package. So a loader finds room for what fits here, and sometimes for more.
    """
    for package in packages:
        missing = [each for each in package.handling if each not in bay.carries]
        if missing:
            carried = ", ".join(bay.carries) or "nothing with handling"
            detail = (
                f"package {package.package_id!r} needs {missing[0]}; the drone carries {carried}"
            )
            return Misfit("HANDLING", detail)
        if package.dangerous_class and not _is_covered(package.dangerous_class, bay):
            classes = ", ".join(bay.dangerous_classes) or "none"
            detail = (
                f"package {package.package_id!r} is of class {package.dangerous_class}; the drone "
                f"carries the classes {classes}"
            )
            return Misfit("HANDLING", detail)
    if bay.cargo_mm is None or _fit(bay.cargo_mm, packages):
        return None
    box = "x".join(map(str, (bay.cargo_mm.length, bay.cargo_mm.width, bay.cargo_mm.height)))
    for package in packages:
        if not _fit(bay.cargo_mm, [package]):
            detail = f"package {package.package_id!r} does not fit into the cargo box of {box} mm"
            return Misfit("TOO_LARGE", detail)
    return Misfit("TOO_LARGE", f"the packages do not fit together into the cargo box of {box} mm")


def _is_covered(dangerous_class: str, bay: CargoBay) -> bool:
    return any(each in (dangerous_class, dangerous_class[0]) for each in bay.dangerous_classes)


def _fit(box: SizeMm, packages: Sequence[Cargo]) -> bool:
    """Whether the packages stand in rows along one side of the box."""
    return any(
        _fit_in_rows(along_mm, across_mm, box.height, packages)
        for along_mm, across_mm in ((box.length, box.width), (box.width, box.length))
    )


def _fit_in_rows(along_mm: int, across_mm: int, height_mm: int, packages: Sequence[Cargo]) -> bool:
    """Whether rows of packages fit: the widest packages first, each row as full as possible."""
    floors = []
    for package in packages:
        ways = [
            way
            for way in _ways_to_stand(package)
            if way[0] <= along_mm and way[1] <= across_mm and way[2] <= height_mm
        ]
        if package.size_mm is not None and not ways:
            return False
        # The smallest floor; among equal ones the narrowest.
        floors += [min(ways, key=lambda way: (way[0] * way[1], way[1]))] if ways else []
    used_across_mm = left_mm = 0
    for long_mm, wide_mm, _ in sorted(floors, key=lambda way: (-way[1], -way[0])):
        if long_mm > left_mm:
            used_across_mm, left_mm = used_across_mm + wide_mm, along_mm
        left_mm -= long_mm
    return used_across_mm <= across_mm


def _ways_to_stand(package: Cargo) -> Iterator[tuple[int, int, int]]:
    """Along the row, across it, and upwards: how a package may stand, in millimetres."""
    if package.size_mm is None:
        return
    length, width, height = package.size_mm.length, package.size_mm.width, package.size_mm.height
    if "UPRIGHT" in package.handling:
        yield from ((length, width, height), (width, length, height))
    else:
        yield from permutations((length, width, height))
