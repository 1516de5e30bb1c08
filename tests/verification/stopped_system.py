"""A system that has run for a few seconds, and the databases that it left."""

import signal
from collections.abc import Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any, Final

from tests.end_to_end.corridor_network import corridor
from tests.end_to_end.local_system import LocalSystem

#: The ids of a system's deliveries and of what belongs to them, by the words of the corruptions.
Ids = Mapping[str, str]

#: Fleet seconds in a second: a flight to the next station takes ten seconds.
RATE: Final = 60.0

_PLACES: Final = {
    "line-s1": [-97.88, 29.5],
    "line-near": [-97.87, 29.5],
    "line-s4": [-97.52, 29.5],
    "line-s5": [-97.4, 29.5],
    # 200 m from the third station.
    "line-s3": [-97.64, 29.5],
    "line-s6": [-97.642, 29.5],
}


_FASTEST: Final = {"objective": "FASTEST"}
_SHARED: Final = {"objective": "CHEAPEST", "pooling": True}
_NEAR: Final = {**_SHARED, "pickup_within_m": 500}


class _Receiver(BaseHTTPRequestHandler):
    """A customer's server that accepts every notification."""

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


def run_and_stop(system: LocalSystem) -> Ids:
    """Fly deliveries, and stop the system while one is in the air; the ids.

    One delivery is completed, one has delivered its first package and flies on with the second, one
    waits for the answer of a drone that stands still, two are queued behind it, and a third one
    shares the trip of the first of these, from a station that is near its own. One waits for a
    drone that never connects, and one is cancelled. An offer of an idle drone is held.
    """
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Receiver)
    thread = Thread(target=server.serve_forever)
    thread.start()
    try:
        return _run(system, f"http://127.0.0.1:{server.server_port}/hook")
    finally:
        _end(system)
        server.shutdown()
        server.server_close()
        thread.join()


def _run(system: LocalSystem, hook: str) -> Ids:
    system.start()
    system.operate("PUT", "/v1/networks/line", _line())
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    system.operate("POST", "/v1/session-links", None)
    _fill_newer_tables(system)
    webhook = system.call("POST", "/v1/webhooks", key=key, body={"url": hook}).json()
    deaf = system.call("POST", "/v1/webhooks", key=key, body={"url": "http://127.0.0.1:9/"}).json()
    flyer = system.start_fleet(["line-s1"], name="Flying Air")
    tariff = {"currency": "USD", "base": 100, "per_km": 10, "pooled_factor": 0.5}
    silent = system.start_fleet(["line-s4"], name="Silent Air", tariff=tariff)
    idle = system.start_fleet(["line-s4"], name="Idle Air")
    absent = _register_absent_drone(system)
    system.operate("POST", "/v1/stations/line-s5/closures", {"reason": "roof works"})
    completed = _accept_an_offer(system, key, by=flyer)
    system.until_state(completed, "COMPLETED")
    flying = _request(system, key, "line-s1", "line-near", "line-s3", by=flyer)
    system.eventually(lambda: _flies_on(system, flying), "the second package in the air")
    _renew_and_withdraw_links(system, key, completed, flying)
    # However slow the machine is, the package stays in the air. What follows is short: after a
    # few seconds composition would see that no drone moves, and plan again.
    for fleet in system.fleets:
        fleet.send_signal(signal.SIGSTOP)
    held = system.call(
        "POST", "/v1/quotes", key=key, body={**_body("line-s4", "line-s2", by=idle), "hold": True}
    ).json()
    assert held["offers"][0]["is_held"], held
    booked = _request(system, key, "line-s4", "line-s3", by=silent)
    system.until_state(booked, "PLANNED")
    queued = _request(system, key, "line-s3", "line-near", by=silent, qos=_SHARED)
    system.until_state(queued, "PLANNED")
    # So light that the first one's drone need not charge longer for it.
    guest = _request(system, key, "line-s6", "line-near", by=silent, qos=_NEAR, mass_kg=0.001)
    system.until_state(guest, "PLANNED")
    assert system.delivery(guest)["pickup"] == {"station_id": "line-s3"}
    queued_behind = _request(system, key, "line-near", "line-s1", by=silent)
    system.until_state(queued_behind, "PLANNED")
    waiting = _request(system, key, "line-s3", "line-s2", by=absent)
    cancelled = _request(system, key, "line-s1", "line-near", by=silent)
    system.call("POST", f"/v1/deliveries/{cancelled}/cancel", key=key, body={})
    system.until_state(cancelled, "CANCELLED")
    return {
        "completed": completed,
        "flying": flying,
        "booked": booked,
        "completed_mission": _mission_of(system, completed),
        "flying_mission": _mission_of(system, flying),
        "booked_mission": _mission_of(system, booked),
        "queued": queued,
        "guest": guest,
        "queued_mission": _mission_of(system, queued),
        "queued_behind_mission": _mission_of(system, queued_behind),
        "waiting": waiting,
        "cancelled": cancelled,
        "webhook": webhook["webhook_id"],
        "deaf_webhook": deaf["webhook_id"],
        "flying_drone": flyer["drones"][0]["drone_id"],
        "idle_drone": idle["drones"][0]["drone_id"],
        "silent_drone": silent["drones"][0]["drone_id"],
    }


def _fill_newer_tables(system: LocalSystem) -> None:
    """Make keys, one of which is deleted, a session of the operator's browser, and a forecast."""
    body = {"role": "customer", "subject_id": "river-books", "scopes": ["deliveries:read"]}
    system.operate("POST", "/v1/keys", body)
    gone = system.operate("POST", "/v1/keys", {"role": "operator", "subject_id": "lee"})
    system.operate("DELETE", f"/v1/keys/{gone['key_id']}", None)
    system.operate("POST", "/v1/sessions", None)
    now = system.operate("GET", "/v1/clock")["now"]
    report = {"station_id": "line-s1", "valid_at": now, "wind_speed_mps": 0.0, "wind_from_deg": 0.0}
    weather = {"source": "test", "issued_at": now, "reports": [report]}
    system.operate("PUT", "/v1/networks/line/weather", weather)


def _renew_and_withdraw_links(system: LocalSystem, key: str, renewed: str, withdrawn: str) -> None:
    system.call("POST", f"/v1/deliveries/{renewed}/tracking-link", key=key)
    system.call("DELETE", f"/v1/deliveries/{withdrawn}/tracking-link", key=key)


def _end(system: LocalSystem) -> None:
    """End the services before the drones, so that they do not notice their end."""
    if system.up is not None:
        system.up.terminate()
        system.up.wait()
    for fleet in system.fleets:
        fleet.kill()
    system.stop()


def _register_absent_drone(system: LocalSystem) -> Mapping[str, Any]:
    """A provider whose only drone never connects."""
    terms = {"name": "Absent Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}}
    registered: Mapping[str, Any] = system.operate("POST", "/v1/providers", terms)
    drones = [{"model_id": "paper-scenario", "home_station_id": "line-s4"}]
    system.operate("POST", f"/v1/providers/{registered['provider_id']}/drones", drones)
    return registered


def _line() -> dict[str, Any]:
    """The corridor's stations, `line-near` and `line-s6` in sight of two, and `line-s5` away."""
    network = corridor("line")
    for station_id in ("line-near", "line-s5", "line-s6"):
        network["features"].append(
            {
                "type": "Feature",
                "geometry": {"type": "Point", "coordinates": _PLACES[station_id]},
                "properties": {"kind": "station", "station_id": station_id, "pads": 2},
            }
        )
    for end, other in (("line-s1", "line-near"), ("line-s4", "line-s5"), ("line-s3", "line-s6")):
        ends = [_PLACES[end], _PLACES[other]]
        network["features"].append(
            {
                "type": "Feature",
                "geometry": {"type": "LineString", "coordinates": ends},
                "properties": {"kind": "segment", "from": end, "to": other},
            }
        )
    return network


def _body(pickup: str, *destinations: str, by: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "pickup": {"station_id": pickup},
        "packages": [
            {"package_id": f"p{number}", "mass_kg": 0.5, "destination": {"station_id": place}}
            for number, place in enumerate(destinations, start=1)
        ],
        "qos": {**_FASTEST, "providers": {"pinned": by["provider_id"]}},
    }


def _request(
    system: LocalSystem,
    key: str,
    pickup: str,
    *destinations: str,
    by: Mapping[str, Any],
    qos: Mapping[str, Any] = _FASTEST,
    mass_kg: float = 0.5,
) -> str:
    body = _body(pickup, *destinations, by=by)
    body["qos"] |= qos
    for package in body["packages"]:
        package["mass_kg"] = mass_kg
    headers = {"Idempotency-Key": f"from {pickup} to {destinations}, {mass_kg} kg"}
    answer = system.call("POST", "/v1/deliveries", key=key, body=body, **headers)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["delivery_id"])


def _accept_an_offer(system: LocalSystem, key: str, *, by: Mapping[str, Any]) -> str:
    body = _body("line-s1", "line-near", by=by)
    quote = system.call("POST", "/v1/quotes", key=key, body=body).json()
    accepted = {"quote_id": quote["quote_id"], "offer_id": quote["offers"][0]["offer_id"]}
    accepted["recipient"] = {"name": "Ana Ruiz"}
    answer = system.call("POST", "/v1/deliveries", key=key, body=accepted)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["delivery_id"])


def _mission_of(system: LocalSystem, delivery_id: str) -> str:
    return str(system.delivery(delivery_id)["missions"][0]["mission_id"])


def _flies_on(system: LocalSystem, delivery_id: str) -> bool:
    delivery = system.delivery(delivery_id)
    states = [package["state"] for package in delivery["packages"]]
    return states == ["DELIVERED", "IN_TRANSIT"] and delivery["activity"] == "FLYING"
