"""The look of each controller: the same everywhere in a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mobman.benchmark.report.cells import unique
from mobman.benchmark.report.chart import Look, Marker
from mobman.benchmark.report.content import ReportedRun

# Okabe and Ito's palette, told apart with every kind of colour blindness; its yellow and its black
# are left out, since one is lost on white and the other on dark pages. Beside each, the same hue for
# dark pages.
COLOURS = (
    ("#0072b2", "#3f9fdd"),
    ("#d55e00", "#ee7b30"),
    ("#009e73", "#2cbf94"),
    ("#cc79a7", "#dd95bd"),
    ("#e69f00", "#eeb33a"),
    ("#56b4e9", "#93d2f7"),
    ("#777777", "#a9adb3"),
)
# Nine colours for motors: they never meet the controllers' in one figure.
_MOTORS = (
    ("#332288", "#8f83e0"),
    ("#88ccee", "#88ccee"),
    ("#117733", "#47b06a"),
    ("#ddaa33", "#ddaa33"),
    ("#cc6677", "#de8592"),
    ("#aa4499", "#cd72bf"),
    ("#44aa99", "#5fc4b4"),
    ("#882255", "#c75f95"),
    ("#777777", "#a9adb3"),
)
_MARKERS: tuple[Marker, ...] = ("circle", "square", "triangle", "diamond", "wedge", "plus", "star")

# Curves often coincide: neighbours differ in width, the thinner above, so that all can be seen.
_WIDTHS = (3.2, 2.1, 1.2)
_EXPLICIT = (4.0, 2.0)
_TUNED = (9.0, 2.5)
_AGAIN = (6.0, 1.5, 1.0, 1.5)


def styles_of(
    labels: Sequence[str],
    runs: Sequence[ReportedRun],
    tuned: Mapping[str, Mapping[str, Any]] | None = None,
) -> dict[str, Look]:
    """A look for each label.

    The explicit form of a law has the colour of its implicit form, dashed; what is tuned has that of
    what it was tuned from.

    Args:
        labels: Of the controllers.
        runs: Theirs.
        tuned: By label, how its gains were tuned.
    """
    laws = {run.label: run.law for run in reversed(runs)}
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
    parents = {label: str(item.get("label")) for label, item in (tuned or {}).items()}
    own_tuned = {label for label, parent in parents.items() if parent != label and parent in labels}
    sibling |= {label: sibling.get(parents[label], parents[label]) for label in own_tuned}
    own = unique([sibling.get(label, label) for label in labels])
    styles = {}
    for index, label in enumerate(labels):
        place = own.index(sibling.get(label, label))
        # every label of a colour has its own dashes, and its own marker
        again = place // len(COLOURS)
        colour, dark = COLOURS[place % len(COLOURS)]
        dashes: tuple[float, ...] = tuple(2.0 * again * length for length in _AGAIN) or ()
        dashes = _EXPLICIT if label in explicit else dashes if again else ()
        dashes = _TUNED if label in own_tuned else dashes
        styles[label] = Look(
            key=f"k{index}",
            colour=colour,
            dark=dark,
            dashes=dashes,
            width=1.1 if label in explicit else _WIDTHS[place % 3],
            # the explicit form beneath the others: it chatters over everything
            order=1.5 if label in explicit else 2.0 + 0.1 * (place % 3) + 0.001 * place,
            marker=_MARKERS[place % len(_MARKERS)],
            hollow=label in explicit or label in own_tuned,
        )
    return styles


def motor_looks(n: int) -> list[Look]:
    """A look for each of n motors."""
    return [
        Look(
            key=f"m{motor}",
            colour=_MOTORS[motor % len(_MOTORS)][0],
            dark=_MOTORS[motor % len(_MOTORS)][1],
            dashes=(5.0, 2.0) if motor >= len(_MOTORS) else (),
            width=1.2,
        )
        for motor in range(n)
    ]
