"""One hour of requests under each policy of booking drones: the section of the page."""

from collections.abc import Mapping, Sequence
from statistics import mean

from skyway_lab.experiments.figures import Axis, Stack, draw_groups, draw_stacks
from skyway_lab.experiments.fleet_hour.calendars import CHAINED, ONE_AT_A_TIME, POLICIES, Policy
from skyway_lab.experiments.fleet_hour.cases import PLACES, Load, Place
from skyway_lab.experiments.fleet_hour.measures import (
    LONGEST_WAIT_MS,
    HourMeasures,
    HourTrial,
    measure,
)
from skyway_lab.experiments.fleet_hour.utilisation import USES
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

#: The measures of all instances of a place, a load and a policy.
Results = Mapping[tuple[Place, Load, str], Sequence[HourMeasures]]


def fleet(laboratory: Laboratory) -> Section:
    """Delays, drone-hours and energy of a fleet under each policy."""
    loads = laboratory.size(quick=(Load(3, 9),), full=(Load(10, 50), Load(25, 100)))
    trials = [
        HourTrial(place, load, policy, laboratory.seed_for("fleet-hour", place, str(load), number))
        for place in PLACES
        for load in loads
        for number in range(laboratory.size(quick=1, full=3))
        for policy in POLICIES
    ]
    measured = laboratory.results("fleet", measure, trials)
    results: dict[tuple[Place, Load, str], list[HourMeasures]] = {}
    for trial, measures in zip(trials, measured, strict=True):
        key = (trial.place, trial.load, trial.policy.name)
        results.setdefault(key, []).append(measures)
    rows = [each.row(trial) for trial, each in zip(trials, measured, strict=True)]
    write_rows(laboratory.folder / "fleet.csv", rows)
    _draw(laboratory, results, loads[-1])
    return _section(results, loads, seed=laboratory.seed)


def _draw(laboratory: Laboratory, results: Results, load: Load) -> None:
    draw_groups(
        laboratory.folder / "fleet-delay.png",
        f"Mean time from request to last delivery ({load})",
        x=Axis("case"),
        y=Axis("minutes"),
        groups=PLACES,
        bars=[
            Stack(
                policy.name,
                [_delays(results[place, load, policy.name]).mean().value for place in PLACES],
            )
            for policy in POLICIES
        ],
    )
    city = [results["city", load, policy.name] for policy in POLICIES]
    draw_stacks(
        laboratory.folder / "fleet-use.png",
        f"What drones do until the last delivery (city, {load})",
        x=Axis("policy"),
        y=Axis("share of the drones' time, %"),
        bars=[policy.name.replace(" ", "\n") for policy in POLICIES],
        stacks=[
            Stack(use, [100 * mean(each.shares[use] for each in some) for some in city])
            for use in USES
        ]
        + [Stack("idle", [100 * mean(each.idle_share for each in some) for some in city])],
    )


def _delays(measured: Sequence[HourMeasures]) -> Sample:
    """Minutes from request to last delivery, of all instances."""
    return Sample.of([delay for each in measured for delay in each.delays_min])


def _section(results: Results, loads: Sequence[Load], *, seed: int) -> Section:
    rows = [
        (f"{place}, {load}", policy.name, *_cells(results[place, load, policy.name], seed=seed))
        for load in loads
        for place in PLACES
        for policy in POLICIES
    ]
    header = (
        "case",
        "policy",
        "served",
        "mean",
        "p90",
        "drone-hours",
        "kWh",
        *USES,
        "idle",
    )
    findings = [
        SummaryLine(
            f"{place}, {loads[-1]}: {ONE_AT_A_TIME.name} against {CHAINED.name}",
            _comparison(results, place, loads[-1]),
        )
        for place in PLACES
    ]
    return Section(
        "A fleet's hour: one mission at a time, or a calendar",
        [
            _INTRODUCTION,
            _POLICIES,
            image("fleet-delay.png", "mean delay by case and policy"),
            image("fleet-use.png", "what drones do, by policy"),
            markdown_table(header, rows),
        ],
        findings,
    )


def _cells(measured: Sequence[HourMeasures], *, seed: int) -> Sequence[str]:
    delays = _delays(measured)
    shares = [mean(each.shares[use] for each in measured) for use in USES]
    estimate = delays.mean(seed=seed)
    return (
        percent(mean(each.served_share for each in measured)),
        f"{estimate.value:.0f} ({estimate.low:.0f} to {estimate.high:.0f})",
        f"{delays.quantile(0.9, seed=seed).value:.0f}",
        f"{mean(each.held_h for each in measured):.0f}",
        f"{mean(each.energy_kwh for each in measured):.1f}",
        *map(percent, shares),
        percent(mean(each.idle_share for each in measured)),
    )


def _comparison(results: Results, place: Place, load: Load) -> str:
    def of(policy: Policy) -> Sequence[HourMeasures]:
        return results[place, load, policy.name]

    def change(name: str, unit: str) -> str:
        before, after = (
            mean(getattr(each, name) for each in of(policy)) for policy in (ONE_AT_A_TIME, CHAINED)
        )
        return f"{before:.0f} to {after:.0f} {unit}"

    served = [percent(mean(each.served_share for each in of(p))) for p in (ONE_AT_A_TIME, CHAINED)]
    means = [_delays(of(policy)).mean().value for policy in (ONE_AT_A_TIME, CHAINED)]
    return (
        f"served {served[0]} to {served[1]}, mean {means[0]:.0f} to {means[1]:.0f} min, "
        f"{change('held_h', 'drone-hours')}, {change('energy_kwh', 'kWh')}"
    )


_INTRODUCTION = (
    "Requests of one hour, at random moments, are booked in the order of asking: the exact planner "
    "composes from every drone that can be booked, and the drone that delivers first is booked "
    "with its pads. All is flown as planned. Calendars, standby and pads are the code of the "
    "services (`skyway.scheduling`), with the services' defaults for margins and stops. Drones "
    "(`dji-matrice-300-rtk`) begin charged, at homes all over the network. Every station has one "
    "pad. A request has one or two packages, for stations within 25 km. The **city** is random (40 "
    "stations, 5 km apart), the **corridor** is the bundled one in Texas. At a **hub** all "
    "packages come from the city's most central station, or from the most central stations of its "
    "three parts."
)
_POLICIES = (
    "**One at a time**: a drone flies home after its last delivery, and is busy until it is "
    "charged there. **Free while charging**: it can be booked as soon as it is home. **Stay**: it "
    "charges where it delivered, or at the nearest pad, and can be booked as soon as it has "
    "delivered. **Chained, home**: requests are booked behind busy drones; a drone without a next "
    "mission flies home (the default of the services). **Chained**: the same, and drones stay. "
    f"**Served** is the share of requests for which a drone is booked within "
    f"{duration(LONGEST_WAIT_MS / 1000)}; then customers give up. In all other columns nobody "
    "gives up. **Mean** and **p90** are minutes from the request to its last delivery. "
    "**Drone-hours** count from a mission's start until its drone can be booked again. "
    "Shares are of the drones' time until the last delivery."
)
