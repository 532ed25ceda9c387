"""Colours, dashes and markers: a law looks the same in the report, in pictures and in the viewer."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

# Okabe and Ito's palette, distinguishable with every kind of colour blindness, without its yellow
# and black, which are lost on white and on dark pages.
LAWS = {
    "tsm": "#0072b2",
    "tsm-simplified": "#56b4e9",
    "tsm-inverse-actuation": "#009e73",
    "tsm-null-space": "#7a5195",
    "pseudo-inverse": "#d55e00",
    "damped-least-squares": "#e69f00",
    "extended-jacobian": "#cc79a7",
}
_SOLID = (1.0, 0.0)
_OTHERS = ("#8c564b", "#777777", "#44aa99")
MOTORS = (
    *("#4f46b8", "#56b4e9", "#1f8a4c", "#c99700", "#cc6677"),
    *("#aa4499", "#2f9e8f", "#a03060", "#777777"),
)
_MARKERS = (
    *("circle", "square", "triangle-up", "diamond"),
    *("triangle-down", "triangle-right", "triangle-left"),
)
# Curves often coincide: neighbours differ in width, and the thinner are drawn above, the thinnest with
# gaps, so that all of them show.
_LINES: Sequence[tuple[float, tuple[float, ...]]]
_LINES = (4.6, _SOLID), (2.4, _SOLID), (1.4, (9.0, 6.0))
_EXPLICIT = (3.0, 2.0)
_TUNED = (9.0, 2.5)
_AGAIN = (6.0, 1.5, 1.0, 1.5)


class Look(NamedTuple):
    """Colour, line and marker of a controller or a motor."""

    colour: str
    dashes: tuple[float, ...] = _SOLID  # lengths of dashes and gaps (px); solid by default
    width: float = 1.4
    marker: str = "circle"

    @property
    def depth(self) -> float:
        """Place in the order of drawing: explicit laws, which chatter, first, then the wide lines."""
        return -10.0 if self.dashes == _EXPLICIT else -self.width


def colours(laws: Sequence[str]) -> list[str]:
    """Give each law its colour; those that have none of their own get what is left, in order."""
    own = [law for law in dict.fromkeys(laws) if law not in LAWS]
    left = [*_OTHERS, *(c for law, c in LAWS.items() if law not in laws)]
    given = LAWS | {law: left[i % len(left)] for i, law in enumerate(own)}
    return [given[law] for law in laws]


def looks_of(
    laws: Mapping[str, str],
    explicit: Collection[str] = (),
    tuned: Mapping[str, str] | None = None,
) -> dict[str, Look]:
    """Give each label a look of its own.

    Args:
        laws: The law of each label.
        explicit: Labels of explicit discretisations: dashed, in the colour of their law.
        tuned: By label with tuned gains, the label that these were tuned from, whose colour it has.
    """
    parents = {a: b for a, b in (tuned or {}).items() if a != b and b in laws}
    first: dict[str, str] = {}
    for label, law in laws.items():
        if label not in explicit and label not in parents:
            first.setdefault(law, label)
    # labels of one law that is neither explicit nor tuned have colours of their own
    own = {
        label: parents.get(label, first.get(law, label) if label in explicit else label)
        for label, law in laws.items()
    }
    heads = list(dict.fromkeys(own.get(head, head) for head in own.values()))
    names = [laws[head] if first.get(laws[head]) == head else f"label {head}" for head in heads]
    palette = dict(zip(heads, colours(names), strict=True))
    used: dict[str, int] = {}
    looks = {}
    for label in laws:
        head = own.get(own[label], own[label])
        place, colour = heads.index(head), palette[head]
        again = used[colour] = used.get(colour, -1) + 1
        width, dashes = _LINES[place % 3]
        if again:
            dashes = tuple(0.5 * (again + 1) * length for length in _AGAIN)
        if label in explicit or label in parents:
            width, dashes = (1.1, _EXPLICIT) if label in explicit else (width, _TUNED)
        looks[label] = Look(colour, dashes, width, _MARKERS[place % len(_MARKERS)])
    return looks


def motor_looks(names: Sequence[str]) -> dict[str, Look]:
    """Give each motor a look; their colours never meet the controllers' in one figure."""
    n = len(MOTORS)
    return {
        name: Look(MOTORS[i % n], _SOLID if i < n else (4.0 + 2.0 * (i // n), 2.0))
        for i, name in enumerate(names)
    }
