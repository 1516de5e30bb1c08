"""What a run has found out, and the tables that it prints."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from skyway_lab.benchmarks.chaos.customers import Requests
from skyway_lab.benchmarks.chaos.evidence import Evidence
from skyway_lab.benchmarks.chaos.judgement import Flaw
from skyway_lab.benchmarks.chaos.recovery import Recovery, by_fault, middle_and_worst
from skyway_lab.benchmarks.chaos.trial import Trial
from skyway_lab.benchmarks.planner.table import Table


@dataclass(frozen=True, slots=True)
class Outcome:
    """A run's flaws and figures."""

    trial: Trial
    flaws: tuple[Flaw, ...]
    recoveries: tuple[Recovery, ...]
    requests: Requests
    evidence: Evidence
    quiet_s: float

    def tables(self) -> list[Table]:
        """What a run prints."""
        return [self._counts(), self._answers(), recovery_table("chaos", self.recoveries)]

    def _counts(self) -> Table:
        ends = Counter(answer.state or "unknown" for answer in self.evidence.answers.values())
        steps = Counter(step.kind for step in self.evidence.journals)
        rows: list[tuple[str, ...]] = [
            ("requests accepted", str(len(self.evidence.accepted))),
            ("states in the end", ", ".join(f"{n} {state}" for state, n in ends.most_common())),
            ("steps in journals", ", ".join(f"{n} {kind}" for kind, n in sorted(steps.items()))),
            ("all ended after the last fault", f"{self.quiet_s:.0f} s"),
            ("wait for an operator", str(len(self.evidence.awaited))),
            ("flaws", str(len(self.flaws))),
        ]
        return Table("chaos-counts", "What came of it.", ("measured", "value"), rows)

    def _answers(self) -> Table:
        return Table(
            "chaos-answers",
            "How POSTs were answered, by the fault during or after which they were sent.",
            ("fault", "answer", "times"),
            [
                (fault, answer, str(count))
                for (answer, fault), count in sorted(
                    self.requests.answers.items(), key=lambda item: item[0][::-1]
                )
                if answer != "202"
            ],
        )


def recovery_table(name: str, recoveries: Sequence[Recovery]) -> Table:
    """The figures of each fault: median and worst."""
    return Table(
        name,
        "Wall seconds from the end of a fault, p50 / worst.",
        ("fault", "times", "request accepted", "planned", "dispatched"),
        [
            (
                fault,
                str(len(found)),
                middle_and_worst(found, lambda each: each.accepted_s),
                middle_and_worst(found, lambda each: each.planned_s),
                middle_and_worst(found, lambda each: each.dispatched_s),
            )
            for fault, found in by_fault(recoveries).items()
        ],
    )
