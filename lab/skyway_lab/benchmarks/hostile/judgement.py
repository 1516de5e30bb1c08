"""Judges a hostile run: what may never be answered, how much slower, how much larger."""

from collections.abc import Iterator, Mapping
from typing import Final

from skyway_lab.benchmarks.chaos.judgement import Flaw
from skyway_lab.benchmarks.hostile.probes import Seconds, middle
from skyway_lab.benchmarks.hostile.rogues import Answers

#: Medians below this are as good as calm, wall seconds: they are noise of a small machine.
_AS_GOOD_AS_CALM_S: Final = 0.25
#: A process may grow by this much under attack.
_MOST_GROWTH_MIB: Final = 200.0
#: Most broken calls that are shown.
_SHOWN: Final = 20


def flaws_of(
    answers: Answers,
    *,
    calm: Seconds,
    attacked: Seconds,
    growth_mib: Mapping[str, float],
    most_times: float = 2.0,
) -> Iterator[Flaw]:
    """Everything that the rogues achieved; work may be `most_times` slower, by the median."""
    for broken in answers.broken[:_SHOWN]:
        yield Flaw("broken call", None, broken)
    if len(answers.broken) > _SHOWN:
        yield Flaw("broken call", None, f"{len(answers.broken) - _SHOWN} more")
    for what in calm:
        before_s, under_attack_s = middle(calm[what]), middle(attacked.get(what, ()))
        if before_s is None:
            continue
        if under_attack_s is None:
            yield Flaw("stopped", None, f"{what}: not once under attack")
        elif under_attack_s > max(_AS_GOOD_AS_CALM_S, most_times * before_s):
            yield Flaw("slower", None, f"{what}: {before_s:.3f} s, now {under_attack_s:.3f} s")
    for process, grown_mib in growth_mib.items():
        if grown_mib > _MOST_GROWTH_MIB:
            yield Flaw("memory", None, f"{process} has grown by {grown_mib:.0f} MiB")
