"""The agent stays light: a drone's computer has little memory."""

import subprocess
import sys

HEAVY = {
    "aiosqlite",
    "alembic",
    "amqtt",
    "anyio",
    "asyncpg",
    "fastapi",
    "httpx",
    "multiprocessing",
    "networkx",
    "numba",
    "numpy",
    "prometheus_client",
    "pydantic_settings",
    "rich",
    "skyway_broker",
    "skyway_composition",
    "skyway_gateway",
    "skyway_provider_registry",
    "sqlalchemy",
    "sqlite3",
    "starlette",
    "typer",
    "uvicorn",
    "uvloop",
    "yaml",
}

LIBRARY = {
    "skyway.bounds",
    "skyway.complaints",
    "skyway.contracts",
    "skyway.delivery",
    "skyway.drone",
    "skyway.errors",
    "skyway.geo",
    "skyway.ids",
    "skyway.json_model",
    "skyway.json_text",
    "skyway.runtime",
    "skyway.units",
}


def test_the_agent_imports_nothing_heavy() -> None:
    program = "import sys, skyway_drone_agent.__main__; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60
    )
    modules = done.stdout.split()

    assert HEAVY.isdisjoint(name.split(".")[0] for name in modules)
    parts = {".".join(name.split(".")[:2]) for name in modules if name.startswith("skyway.")}
    assert parts <= LIBRARY
