"""The rendered chart, once for each test process."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.chart.chart_cases import CASES, WRONG
from tests.chart.rendered import Outcomes

ROOT = Path(__file__).parents[2]
TOOLS = ROOT / ".chart_tools"


@pytest.fixture(scope="session")
def outcomes() -> Outcomes:
    """What became of every case of `chart_cases`."""
    if not (TOOLS / "helm_python").exists():
        pytest.skip("Helm's SDK is not in .chart_tools: see CONTRIBUTING.md")
    script = Path(__file__).with_name("render_chart.py")
    done = subprocess.run(
        [sys.executable, script, TOOLS, ROOT / "deploy/helm/skyway"],
        input=json.dumps({**CASES, **WRONG}),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return Outcomes(json.loads(done.stdout))
