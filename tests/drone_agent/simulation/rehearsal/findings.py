"""The broken invariants that a rehearsal has found."""

from dataclasses import dataclass, field


@dataclass
class Findings:
    """Broken invariants, each in words, in the order in which they were seen."""

    broken: list[str] = field(default_factory=list)

    def expect(self, holds: bool, invariant: str, detail: object = "") -> None:
        """Note that the invariant is broken, unless it holds."""
        if not holds:
            self.broken.append(f"{invariant}: {detail}")
