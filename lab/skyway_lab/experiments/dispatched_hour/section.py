"""A fleet's hour under the dispatcher: policies P0, P3 and P4, and how fast a plan improves."""

from collections.abc import Mapping, Sequence
from statistics import mean

from skyway_lab.experiments.dispatched_hour.measures import (
    CALENDARS,
    PLACES,
    SEARCHES,
    SHARED,
    HourOutcome,
    Improvement,
    PlanSearch,
    PolicyHour,
    fly_hour,
    hour_row,
    improve,
    plan_rows,
)
from skyway_lab.experiments.figures import Axis, Line, Stack, draw_groups, draw_lines
from skyway_lab.experiments.fleet_hour.cases import Load, Place
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import (
    Section,
    SummaryLine,
    duration,
    image,
    markdown_table,
    percent,
    write_rows,
)
from skyway_lab.experiments.sample import Sample


def dispatch(laboratory: Laboratory) -> Section:
    """Delays of a fleet whose requests are planned together, and how fast plans improve."""
    load = laboratory.size(quick=Load(3, 6), full=Load(25, 100))
    seeds = range(laboratory.size(quick=1, full=3))
    hours = [
        PolicyHour(place, load, laboratory.seed + seed, policy)
        for place in PLACES
        for policy in (*CALENDARS, *SEARCHES)
        for seed in seeds
        if place in SHARED or policy not in SEARCHES or not SEARCHES[policy].pooling
    ]
    rounds = laboratory.size(quick=(1, 3), full=(1, 3, 10, 30, 100))
    curves = [PlanSearch(place, load, laboratory.seed, rounds) for place in PLACES]
    outcomes = dict(zip(hours, laboratory.results("dispatch, hours", fly_hour, hours), strict=True))
    improvements = dict(
        zip(curves, laboratory.results("dispatch, plans", improve, curves), strict=True)
    )
    rows = [hour_row(one, outcome) for one, outcome in outcomes.items()]
    write_rows(laboratory.folder / "dispatch.csv", rows)
    rows = [row for one, each in improvements.items() for row in plan_rows(one, each)]
    write_rows(laboratory.folder / "dispatch-rounds.csv", rows)
    _draw(laboratory, outcomes, improvements, load)
    return _section(outcomes, improvements, load, rounds)


def _of(
    outcomes: Mapping[PolicyHour, HourOutcome], place: Place, load: Load, policy: str
) -> list[HourOutcome]:
    return [
        outcome
        for hour, outcome in outcomes.items()
        if (hour.place, hour.load, hour.policy) == (place, load, policy)
    ]


def _mean_min(outcomes: Sequence[HourOutcome]) -> float:
    delays = [delay for each in outcomes for delay in each.delays_min]
    return mean(delays) if delays else 0.0


def _draw(
    laboratory: Laboratory,
    outcomes: Mapping[PolicyHour, HourOutcome],
    improvements: Mapping[PlanSearch, Improvement],
    load: Load,
) -> None:
    draw_groups(
        laboratory.folder / "dispatch.png",
        f"Mean time from request to last delivery ({load})",
        x=Axis("case"),
        y=Axis("minutes"),
        groups=PLACES,
        bars=[
            Stack(policy, [_mean_min(_of(outcomes, place, load, policy)) for place in PLACES])
            for policy in (*CALENDARS, *SEARCHES)
        ],
    )
    draw_lines(
        laboratory.folder / "dispatch-rounds.png",
        "How fast a plan improves, all requests known together",
        x=Axis("rounds of the search", "log"),
        y=Axis("mean above what is proven, %"),
        lines=[
            Line(
                curve.name,
                curve.rounds,
                [
                    Sample.of([100 * (each / found.proven_min - 1)]).mean()
                    for each in found.means_min
                ],
            )
            for curve, found in improvements.items()
        ],
    )


def _section(
    outcomes: Mapping[PolicyHour, HourOutcome],
    improvements: Mapping[PlanSearch, Improvement],
    load: Load,
    rounds: Sequence[int],
) -> Section:
    hours = [
        (f"{place}, {load}", policy, *_cells(found))
        for place in PLACES
        for policy in (*CALENDARS, *SEARCHES)
        if (found := _of(outcomes, place, load, policy))
    ]
    plans = [
        (
            curve.name,
            f"{found.arrival_min:.1f}",
            *(
                f"{each:.1f} ({duration(elapsed_s)})"
                for each, elapsed_s in zip(found.means_min, found.elapsed_s, strict=True)
            ),
            f"{found.proven_min:.1f}",
        )
        for curve, found in improvements.items()
    ]
    findings = [
        SummaryLine(f"{place}, {load}", _comparison(outcomes, place, load)) for place in PLACES
    ]
    findings += [
        SummaryLine(
            f"{curve.name}, all known together",
            f"{found.arrival_min:.0f} to {found.means_min[-1]:.0f} min; at most "
            f"{percent(1 - found.proven_min / found.means_min[-1])} can be saved",
        )
        for curve, found in improvements.items()
    ]
    return Section(
        "A fleet's hour: all requests planned together",
        [
            _INTRODUCTION,
            image("dispatch.png", "mean delay by case and policy"),
            markdown_table(("case", "policy", "served", "mean", "on time", "kWh"), hours),
            _PLANS,
            image("dispatch-rounds.png", "mean above what is proven, by rounds"),
            markdown_table(
                ("case", "arrival order", *(f"{each} rounds" for each in rounds), "proven"), plans
            ),
        ],
        findings,
    )


def _cells(found: Sequence[HourOutcome]) -> Sequence[str]:
    return (
        percent(mean(each.served_share for each in found)),
        f"{_mean_min(found):.0f}",
        percent(mean(each.on_time_share for each in found)),
        f"{mean(each.energy_kwh for each in found):.1f}",
    )


def _comparison(outcomes: Mapping[PolicyHour, HourOutcome], place: Place, load: Load) -> str:
    parts = [
        f"{policy} {_mean_min(found):.0f} min"
        for policy in (*CALENDARS, *SEARCHES)
        if (found := _of(outcomes, place, load, policy))
    ]
    return ", ".join(parts)


_INTRODUCTION = (
    "The cases are those of the section about booked missions, with seeds of their own. **P0** and "
    "**P3** are two of its policies: one mission at a time, and a calendar in which a drone's "
    "missions follow one another (chained). **P4**: each minute the dispatcher plans all requests "
    "that have not started, with 5 rounds of at most 20,000 steps. Trips that begin before the "
    "next minute are flown as planned, and a drone that waits charges where it stands. With "
    "**pooling**, requests with the same pickup may share a trip; only hubs have such requests. "
    "**Trips wait**: in the hour in which requests come, a trip waits until three requests "
    "share it, or until its oldest request is 15 min old, and energy has a price. Meanwhile its "
    "drone flies to the pickup, without packages. "
    "**Mean** is the minutes from the request to its last delivery. A request is **on time** if it "
    "is delivered within 30 min, or within twice the time that it needs alone."
)
_PLANS = (
    "In the second figure all requests are known when the hour begins. The search improves one "
    "plan in rounds, and its mean is read after some of them; the table also shows the processor "
    "time until then. **Proven** is the lower bound: no plan has a lower mean "
    "([method](dispatch.md)). The plans depend on the seed only."
)
