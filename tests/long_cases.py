"""The mark `long` on most cases of a test: `make test` runs a sample of them."""

from collections.abc import Iterable
from typing import Any

import pytest


def sampled(cases: Iterable[Any], *, every: int) -> list[Any]:
    """Every so many cases, the first among them; all others have the mark `long`.

    A case is the value of the test's one parameter. Any: each test has its own type.
    """
    return [
        case if number % every == 0 else pytest.param(case, marks=pytest.mark.long)
        for number, case in enumerate(cases)
    ]
