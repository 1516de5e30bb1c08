"""The kernels as plain Python: compiled ones cannot be called one by one."""

import importlib
import sys
from types import SimpleNamespace

import numba
import pytest

_PACKAGE = "skyway.planner.kernels"
_PARTS = ("charging", "closures", "dominance", "memory", "pads", "queue", "records")


@pytest.fixture(scope="session")
def plain() -> SimpleNamespace:
    """A copy of the kernels that is not compiled; all other modules keep the compiled kernels."""
    compiled = {name: sys.modules.pop(name) for name in list(sys.modules) if _is_kernel(name)}
    numba.config.DISABLE_JIT = True
    try:
        parts = {part: importlib.import_module(f"{_PACKAGE}.{part}") for part in _PARTS}
    finally:
        numba.config.DISABLE_JIT = False
        for name in [name for name in sys.modules if _is_kernel(name)]:
            del sys.modules[name]
        sys.modules.update(compiled)
        if _PACKAGE in compiled:
            vars(sys.modules["skyway.planner"])["kernels"] = compiled[_PACKAGE]
    return SimpleNamespace(**parts)


def _is_kernel(name: str) -> bool:
    return name == _PACKAGE or name.startswith(_PACKAGE + ".")
