"""docs/reference/metrics.md names every metric of the code, and no other."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/reference/metrics.md").read_text()


def counted_names() -> Iterator[str]:
    """The names given to `count`, directly or by a variable beside it."""
    for folder in ("skyway", "gateway", "services"):
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text()
            if "runtime.metrics import" not in text:
                continue
            for node in ast.walk(ast.parse(text)):
                if (
                    isinstance(node, ast.Constant)
                    and isinstance(node.value, str)
                    and re.fullmatch(r"skyway_[a-z_]+", node.value)
                ):
                    yield node.value


def test_the_page_names_every_metric_and_no_other() -> None:
    on_page = set(re.findall(r"^\| `(skyway_[a-z_]+)_total` \|", PAGE, re.MULTILINE))
    packages = {path.name for path in (*ROOT.glob("gateway/*"), *ROOT.glob("services/*"))}

    counted = set(counted_names()) - packages

    assert len(counted) > 15
    assert counted == on_page
