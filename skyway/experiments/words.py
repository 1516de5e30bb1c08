"""Numbers and tables in words: what the page and the terminal show."""

import math
from collections.abc import Callable, Sequence

from skyway.experiments.sample import Estimate

_MINUTE_S = 60.0
_HOUR_S = 3600.0

#: A share smaller than this is what rounding left of nothing.
_NOTHING = 1e-9


def duration(value_s: float) -> str:
    """A duration in the unit that reads best."""
    if not math.isfinite(value_s):
        return "never"
    if value_s < 1e-3:
        return f"{value_s * 1e6:.0f} µs"
    if value_s < 1.0:
        return f"{value_s * 1e3:.3g} ms"
    if value_s < 3 * _MINUTE_S:
        return f"{value_s:.3g} s"
    if value_s < _HOUR_S:
        return f"{value_s / _MINUTE_S:.3g} min"
    return f"{value_s / _HOUR_S:.2f} h"


def hours(value_h: float) -> str:
    """A time in hours."""
    return f"{value_h:.2f} h" if math.isfinite(value_h) else "never"


def percent(share: float) -> str:
    """A share of one as a percentage."""
    if not math.isfinite(share):
        return "∞"
    return f"{0 if abs(share) < _NOTHING else share * 100:.3g} %"


def count(number: float) -> str:
    """A whole number, with commas."""
    return "∞" if not math.isfinite(number) else f"{number:,.0f}"


def estimated(estimate: Estimate, form: Callable[[float], str]) -> str:
    """A value, "≥" where it is censored, without its interval."""
    is_at_least = estimate.is_at_least and math.isfinite(estimate.value)
    return f"{'≥ ' if is_at_least else ''}{form(estimate.value)}"


def with_interval(estimate: Estimate, form: Callable[[float], str]) -> str:
    """A value with its 95 % interval."""
    return f"{estimated(estimate, form)} ({form(estimate.low)} to {form(estimate.high)})"


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown; all columns but the first are numbers, set right."""
    rule = ["---", *("---:" for _ in header[1:])]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (header, rule, *rows))
