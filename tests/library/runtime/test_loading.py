"""What a service does not load."""

import json
import subprocess
import sys
from typing import Final

import pytest

_LOADED: Final = """
import importlib, json, sys
from skyway.runtime.loading import begin_loading
begin_loading()
importlib.import_module(sys.argv[1])
print(json.dumps(sorted(name for name, module in sys.modules.items() if module is not None)))
"""


@pytest.mark.parametrize(
    "app", ["skyway_gateway.app", "skyway_provider_registry.app", "skyway_composition.app"]
)
def test_a_service_loads_neither_a_command_line_nor_the_driver_of_a_server(app: str) -> None:
    run = subprocess.run(
        [sys.executable, "-c", _LOADED, app], capture_output=True, text=True, check=True
    )

    loaded = set(json.loads(run.stdout))

    assert app in loaded
    assert not loaded & {"click", "rich", "pygments", "asyncpg"}
