"""docs/reference/metrics.md names every metric of the code, and no other."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from skyway.runtime.metrics import BOUNDS_S

ROOT = Path(__file__).parents[2]
#: What a file imports that names metrics.
_MEASURES = re.compile(r"skyway\.runtime\.metrics import|^class Counters", re.MULTILINE)
PAGE = (ROOT / "docs/reference/metrics.md").read_text()


def counted_names() -> Iterator[str]:
    """The names of metrics, given to what counts and measures or to a variable beside it."""
    for folder in ("skyway", "gateway", "services"):
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text()
            if not _MEASURES.search(text):
                continue
            for node in ast.walk(ast.parse(text)):
                if (
                    isinstance(node, ast.Constant)
                    and isinstance(node.value, str)
                    and re.fullmatch(r"skyway_[a-z_]+", node.value)
                ):
                    yield node.value


def test_the_page_names_every_metric_and_no_other() -> None:
    rows = re.findall(r"^\| (`skyway_[^|]+) \|", PAGE, re.MULTILINE)
    on_page = [name for row in rows for name in re.findall(r"`(skyway_[a-z_]+?)(?:_total)?`", row)]
    packages = {path.name for path in (*ROOT.glob("gateway/*"), *ROOT.glob("services/*"))}

    counted = set(counted_names()) - packages

    assert len(counted) > 40
    assert counted == set(on_page)
    assert len(on_page) == len(set(on_page))


def test_the_page_shows_the_buckets() -> None:
    assert f"in buckets from {BOUNDS_S[0]:g} to {BOUNDS_S[-1]:g} s" in PAGE
