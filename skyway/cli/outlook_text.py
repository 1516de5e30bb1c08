"""What a dry run says about missions, in plain lines for people."""

from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Any

#: A JSON object of the gateway, whose members have no common type.
Document = Mapping[str, Any]

_MINUTE_S = 60.0


def outlook_lines(preview: Document) -> Iterator[str]:
    """What a command would do: the plan, the next landing, and a line for each package."""
    outlook = preview["outlook"]
    yield f"{preview['mission_id']}: {preview['command']} {_consequence(outlook)}"
    if (landing := outlook["next_landing"]) is not None:
        yield f"  the drone lands next at {landing['station_id']}, {_clock(landing['at'])}"
    for package in outlook["packages"]:
        yield f"  {package['package_id']}  {_fate(package)}"


def delay_text(delay: Document) -> str:
    """How much later a mission's last package comes, or why that is not known."""
    if delay["later_by_s"] is not None:
        return f"last package {_later(delay['later_by_s'])}"
    match delay["plan"]:
        case "NEW_PLAN":
            return "not every package is delivered"
        case "NO_PLAN":
            return f"no plan is found ({delay['code']})"
        case "TIME_UP":
            return "no plan was found in time"
        case "NOT_NEEDED":
            return "needs no other plan"
        case _:
            return f"no plan can be made yet ({delay['code']})"


def _consequence(outlook: Document) -> str:
    why = ": ".join(each for each in (outlook["code"], outlook["detail"]) if each)
    match outlook["plan"]:
        case "NEW_PLAN":
            return "would give the drone a new plan"
        case "NO_PLAN":
            return f"finds no plan: {why}"
        case "TIME_UP":
            return "has found no plan in time"
        case "NO_PLAN_YET":
            return f"could not be planned yet: {why}"
    if not outlook["ends_mission"]:
        return "needs no new plan"
    return f"would end the mission{f': {why}' if why else ''}"


def _fate(package: Document) -> str:
    where = package["station_id"] or "a station that is not known yet"
    match package["fate"]:
        case "DELIVERED" if package["later_by_s"] is None:
            return f"is delivered at {where}, {_clock(package['new_eta_at'])}"
        case "DELIVERED":
            times = f"expected {_clock(package['eta_at'])}, then {_clock(package['new_eta_at'])}"
            return f"{times} at {where}, {_later(package['later_by_s'])}"
        case "RETURNED":
            return f"comes back to {where}, {_clock(package['returns_at'])}"
        case "NOT_PICKED_UP":
            return f"is not picked up at {where}"
        case "LEFT_BEHIND":
            return f"is left at {where}"
        case "WAITS":
            return f"waits at {where}"
        case _:
            return "nobody knows before a plan is found"


def _later(by_s: float) -> str:
    if abs(by_s) < 1:
        return "no later"
    word = "later" if by_s > 0 else "earlier"
    minutes, seconds = divmod(round(abs(by_s)), _MINUTE_S)
    return f"{minutes:.0f} min {seconds:.0f} s {word}"


def _clock(moment: str) -> str:
    return f"{datetime.fromisoformat(moment):%H:%M:%S}"
