"""Honest callers beside tenants and addresses that do the dearest things their budgets allow."""

import asyncio
import json
import os
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from datetime import datetime, timedelta
from typing import Any, Final

import httpx
from pydantic import TypeAdapter
from skyway_lab.benchmarks.hostile.attackers import Attack, Attacker, Call
from skyway_lab.benchmarks.hostile.trial import Trial
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.run import data_folder
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.load.world import populate
from skyway_lab.benchmarks.planner.table import Table

from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import System, running_system

#: So many tenants, and so many addresses without a key, attack at the same time.
_CROWDS: Final = (1, 50)
#: Deliveries of each attacking tenant: a list of them is dear.
_DELIVERIES: Final = 40
_EVERY_S: Final = 0.2
_SETTLES_S: Final = 5.0

Seconds = dict[str, list[float]]


async def budgets(trial: Trial) -> Table:
    """What an honest customer waits for, calm and beside crowds of attackers."""
    table = Table(
        "hostile-budgets",
        f"Wall milliseconds until an honest customer has an answer, {trial.storage} pair.",
        ("attackers", "POST p50", "POST p95", "GET p50", "GET p95", "worst", "attackers' calls"),
    )
    burst = Burst(trial.storage, trial.stations, trial.drones, 2, 1, 1, 60.0, 1, 30.0, trial.seed)
    city = City.of(stations=trial.stations, seed=trial.seed)
    with data_folder() as folder, storage_pair(trial.storage, folder):
        ports = Ports(gateway=0, broker=0)
        async with (
            running_system(folder, rate=60.0, ports=ports, say=print) as system,
            GatewayApi(system.urls["gateway"]) as api,
        ):
            key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
            await populate(system, api, city, operator_key=key, burst=burst)
            bodies = [
                json.loads(each.body) for each in city.requests(rate_per_s=9, seconds=99, seed=1)
            ]
            honest = await _tenant(api, key, "honest")
            await _lived(system, honest, bodies, seconds=_SETTLES_S)
            calm = await _lived(system, honest, bodies, seconds=trial.phase_s / 2)
            table.rows.append(_row("none", calm, Counter()))
            tenants = [await _tenant(api, key, f"rogue-{n}") for n in range(max(_CROWDS))]
            owned = [await _deliveries(api, tenant, bodies) for tenant in tenants]
            rogues = list(zip(tenants, owned, strict=True))
            for crowd in _CROWDS:
                attackers = [
                    *(_tenant_attacker(*each) for each in rogues[:crowd]),
                    *(_anonymous(f"127.7.0.{n + 1}") for n in range(crowd)),
                ]
                async with _attacking(system, attackers, seed=trial.seed) as answers:
                    await asyncio.sleep(_SETTLES_S)
                    found = await _lived(system, honest, bodies, seconds=trial.phase_s / 2)
                table.rows.append(_row(f"{crowd} tenants, {crowd} addresses", found, answers))
                for what, times in sorted(answers.items()):
                    print(f"  {crowd}: {what}: {times}")
    return table


async def _tenant(api: GatewayApi, operator_key: str, name: str) -> str:
    """The key of a new customer."""
    body = {"role": "customer", "subject_id": name}
    return str((await api.call("POST", "/v1/keys", key=operator_key, body=body))["key"])


async def _deliveries(api: GatewayApi, key: str, bodies: Sequence[Any]) -> list[str]:
    """Deliveries of a tenant for a later day, which nobody flies now."""
    now = (await api.call("GET", "/v1/clock", key=key))["fleet_at"]
    later = TypeAdapter(Any).validate_python(now)
    made = []
    for body in bodies[:_DELIVERIES]:
        asked = {**body, "earliest_pickup_at": _days_later(later)}
        made.append((await api.call("POST", "/v1/deliveries", key=key, body=asked))["delivery_id"])
    return made


def _days_later(moment: str) -> str:
    return (datetime.fromisoformat(moment) + timedelta(days=3)).isoformat()


async def _lived(system: System, key: str, bodies: Sequence[Any], *, seconds: float) -> Seconds:
    """Request and read deliveries for a while; how long each took."""
    found: Seconds = {"POST": [], "GET": []}
    headers = {"Authorization": f"Bearer {key}"}
    ends_s, number, delivery = time.monotonic() + seconds, 0, ""
    async with httpx.AsyncClient(
        base_url=system.urls["gateway"], headers=headers, timeout=30.0
    ) as client:
        while time.monotonic() < ends_s:
            began_s = time.monotonic()
            if number % 2 == 0 or not delivery:
                answer = await client.post("/v1/deliveries", json=bodies[number % len(bodies)])
                what = "POST"
            else:
                answer = await client.get(f"/v1/deliveries/{delivery}")
                what = "GET"
            found[what].append(time.monotonic() - began_s)
            if not answer.is_success:
                print(f"  an honest {what} was answered {answer.status_code}: {answer.text[:200]}")
            elif what == "POST":
                delivery = answer.json()["delivery_id"]
            number += 1
            await asyncio.sleep(max(0.0, began_s + _EVERY_S - time.monotonic()))
    return found


def _tenant_attacker(key: str, owned: Sequence[str]) -> Attacker:
    headers = {"Authorization": f"Bearer {key}"}
    package = {"package_id": 1, "mass_kg": "x", "destination": {"station_id": []}, "reference": 5}
    wrong = json.dumps({"pickup": {}, "packages": [package] * 100, "qos": {"objective": 1}})
    unknown = json.dumps({f"x{number}": 1 for number in range(20_000)})
    return Attacker(
        "127.6.0.1",
        [
            Call("list", "GET", "/v1/deliveries?limit=200", headers),
            Call("wrong delivery", "POST", "/v1/deliveries", headers, wrong),
            Call("unknown members", "POST", "/v1/quotes", headers, unknown),
            Call("events", "GET", f"/v1/deliveries/{owned[0]}/events", headers, stream=True),
            Call("live", "GET", "/v1/live", headers, stream=True),
            Call("network", "GET", "/v1/networks/city", headers),
            Call("track", "GET", f"/v1/deliveries/{owned[-1]}/track", headers),
        ],
    )


def _anonymous(address: str) -> Attacker:
    wrong = json.dumps({f"x{number}": 1 for number in range(250)})
    return Attacker(
        address,
        [
            Call("session", "POST", "/v1/sessions", {}, wrong),
            Call("wrong key", "GET", "/v1/clock", {"Authorization": "Bearer sk_wrong"}),
            Call("no key", "POST", "/v1/deliveries", {}, "x" * 200_000),
            Call("document", "GET", "/openapi.json", {}),
            Call("assets", "GET", "/docs/assets/swagger-ui-bundle.js", {}),
            Call("tracking page", "GET", "/t/wrong", {}),
        ],
    )


@asynccontextmanager
async def _attacking(
    system: System, attackers: Sequence[Attacker], *, seed: int
) -> AsyncIterator[Counter[str]]:
    """Attack within the block; afterwards the counter holds how the attackers were answered."""
    answers: Counter[str] = Counter()
    attack = Attack(system.urls["gateway"], seed, list(attackers))
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "skyway_lab.benchmarks.hostile.attackers"),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env=dict(os.environ),
    )
    assert process.stdin is not None
    process.stdin.write(TypeAdapter(Attack).dump_json(attack) + b"\n")
    await process.stdin.drain()
    try:
        yield answers
    finally:
        process.stdin.close()
        printed, _ = await process.communicate()
        answers.update(json.loads(printed))


def _row(who: str, found: Seconds, answers: Counter[str]) -> tuple[str, ...]:
    figures = [
        f"{1000 * at(sorted(found[what])):.0f}"
        for what in ("POST", "GET")
        for at in (_median, _p95)
    ]
    worst = max(max(each) for each in found.values())
    return (who, *figures, f"{1000 * worst:.0f}", str(answers.total()))


def _median(ordered: Sequence[float]) -> float:
    return ordered[len(ordered) // 2]


def _p95(ordered: Sequence[float]) -> float:
    return ordered[min(int(0.95 * len(ordered)), len(ordered) - 1)]
