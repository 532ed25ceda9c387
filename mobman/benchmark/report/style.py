"""The look of each controller: the same everywhere in a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mobman.benchmark.report.cells import unique
from mobman.benchmark.report.content import ReportedRun

# Okabe and Ito's palette, told apart with every kind of colour blindness; its yellow and its black
# are left out, since one is lost on white and the other on dark pages.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#777777")

# Curves often coincide: neighbours differ in width, the thinner above, so that all can be seen.
_WIDTHS = (3.6, 2.3, 1.2)
_SOLID = "solid"
_EXPLICIT = (0.0, (4.0, 2.0))
_AGAIN = (0.0, (6.0, 1.5, 1.0, 1.5))


@dataclass(frozen=True)
class Style:
    """How a controller's curves are drawn."""

    colour: str
    dashes: str | tuple[float, tuple[float, ...]]
    """As matplotlib takes it."""
    width: float
    order: float
    explicit: bool

    @property
    def dash_array(self) -> str:
        """As SVG takes it; empty for a solid line."""
        return "" if isinstance(self.dashes, str) else " ".join(f"{n:g}" for n in self.dashes[1])


def styles_of(labels: Sequence[str], runs: Sequence[ReportedRun]) -> dict[str, Style]:
    """A style for each label.

    The explicit form of a law has the colour of its implicit form, dashed.
    """
    laws = {run.label: run.record.controller for run in reversed(runs)}
    explicit = {run.label for run in runs if run.explicit}
    sibling = {
        label: next(
            (
                other
                for other in labels
                if other not in explicit and laws.get(other) == laws.get(label)
            ),
            label,
        )
        for label in labels
        if label in explicit
    }
    own = unique([sibling.get(label, label) for label in labels])
    styles = {}
    for label in labels:
        place = own.index(sibling.get(label, label))
        again = place >= len(COLOURS)
        styles[label] = Style(
            colour=COLOURS[place % len(COLOURS)],
            dashes=_EXPLICIT if label in explicit else _AGAIN if again else _SOLID,
            width=1.1 if label in explicit else _WIDTHS[place % 3],
            # the explicit form beneath the others: it chatters over everything
            order=1.5 if label in explicit else 2.0 + 0.1 * (place % 3) + 0.001 * place,
            explicit=label in explicit,
        )
    return styles
