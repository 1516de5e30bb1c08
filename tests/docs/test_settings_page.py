"""docs/reference/settings.md is what the settings classes say, and names every variable."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/reference/settings.md").read_text()


def load_tool() -> ModuleType:
    path = ROOT / "tools" / "write_settings.py"
    spec = importlib.util.spec_from_file_location("write_settings", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_tool_writes_the_same_page() -> None:
    assert load_tool().page() == PAGE, "run python tools/write_settings.py"


def test_every_variable_that_the_code_reads_is_on_the_page() -> None:
    folders = ("skyway", "gateway", "services", "deploy")
    files = [
        *(path for name in folders for path in (ROOT / name).rglob("*.py")),
        *(ROOT / "deploy").rglob("*.sh"),
        ROOT / "docker-compose.yml",
    ]
    used = {
        name
        for path in files
        for name in re.findall(r"\bSKYWAY_[A-Z][A-Z_]*[A-Z]\b", path.read_text())
    }

    assert len(used) > 20
    assert not {name for name in used if f"`{name}`" not in PAGE}
