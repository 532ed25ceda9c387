r"""Monitors of a sliding-mode run: what the theorems suppose and conclude, tick by tick.

With the differences of the recorded sliding variables over a tick, what is left of their rates is

.. math:: r = \frac{s_{k+1} - s_k}{dt} - J \dot v_{ref}, \qquad
    r_d = M\,\frac{S_{k+1} - S_k}{dt} - B \dot v + \tfrac12 \dot M S,

which (41) bounds by W and (53), printed without the dot, by chi. They are means over the tick, over
which the law holds g, G and v_ref'; of the other terms of W and chi the larger value of the tick's ends
is taken. M and B are those of the true plant, J is the law's. The gains suffice, V' <= 0, where the
margins are at least 1:

.. math:: \frac{c\,\lambda_{min}(JJ^T)}{a}\,\frac{W + c_0}{|r|}, \qquad
    \frac{C\,\lambda_{min}(BB^T)}{A}\,\frac{\chi + C_0}{|r_d|}.

(42) and (63) are about states off the manifold: inside the unit ball V is rounding, and its rate is NaN.
A law in a metric has :math:`J \Omega J^T`. ``tsm-inverse-actuation`` has, by Theorem 4,
:math:`\lambda_{min}(M^{-1})` of (64) for :math:`\lambda_{min}(BB^T)`,
:math:`r_d = (S_{k+1} - S_k)/dt - M^{-1} B \dot v`, chi' of (66) and :math:`V = S^T S/2`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from mobman.arrays import Array
from mobman.controllers.bounds import rate_along
from mobman.controllers.protocol import controllers
from mobman.errors import SingularityError, UsageError
from mobman.simulation.metrics import Run
from mobman.simulation.singularity import Jacobians

STAGES = ("kinematic", "dynamic")
_BLOCK = 1000  # ticks whose matrices are in memory together
MARGINS = "margin of the gain"
BALL = 1.0 - 1e-9
"""|n| from which on the state is off the manifold."""


def require_monitored(law: Any) -> None:
    """
    Raises:
        UsageError: If the law has no sliding variables that the theorems are about.
    """
    if not hasattr(law, "monitored_signals"):
        laws = controllers.loaded().items()
        having = ", ".join(sorted(name for name, own in laws if hasattr(own, "monitored_signals")))
        name = getattr(law, "name", type(law).__name__)
        raise UsageError(
            f"monitor: the controller {name!r} has no sliding variables s (31) and S (51); "
            f"allowed: {having}"
        )


# Along the run ----------------------------------------------------------------------------------------


class _Rows(NamedTuple):
    """Samples of a monitored law that belong to the same ticks, one row each."""

    t: Array
    q: Array
    z: Array
    s: Array
    S: Array
    s_rate: Array
    """(s_{k+1} - s_k)/dt."""
    S_rate: Array
    v_ref_dot: Array
    v_dot: Array


class _Stage(NamedTuple):
    """One of the two stages: its gains, and rows of what they stand for."""

    c: float
    c_0: float
    a: float
    least: Array
    """lambda_min that a, or A, bounds."""
    s: Array
    n: Array
    weight: float
    """Largest lambda_max(M), for the reaching time of Theorem 2."""
    held: Array
    """Part of W, or chi, that the law holds over a tick."""
    moving: Array
    """The rest of it."""


def monitors(run: Run, law: Any, signals: Mapping[str, Array], command: Array) -> dict[str, Array]:
    """The monitors of a run at its ticks, by their places in the record; the last tick has no rates.

    Args:
        run: The run.
        law: Its controller, after the run.
        signals: Its ``monitored_signals()`` at the ticks, N rows each.
        command: The commanded torque, shape (N, nz).
    """
    k = law.settings()
    own = {name.removeprefix("sliding/"): values for name, values in signals.items()}
    s, S, dt = own["s"], own["S"], run.dt
    rows = _Rows(
        *(
            run.t,
            run.q,
            run.z,
            s,
            S,
            (_next(s) - s) / dt,
            (_next(S) - S) / dt,
            own["v_ref_dot"],
            own["v_dot"],
        )
    )
    with np.errstate(all="ignore"):  # of a run that diverged
        found = _along(run, law, rows, own["g"])
        largest = np.nanmax(found.pop("lambda_max_M"), initial=0.0)
        w_7, w_8 = (1.0, 0.0) if law.inverse_actuation else (k["w_7"], k["w_8"])  # chi' under (66)
        kinematic = _Stage(
            *(k["c"], k["c_0"], k["a"], found["lambda_min_J"], s, own["n"], 1.0),
            held=found.pop("drift"),
            moving=_moving_part_of_W(k, run, _before(own["v_ref"])),
        )
        dynamic = _Stage(
            *(k["C"], k["C_0"], k["A"], found["lambda_min_B"], S, own["n_d"]),
            1.0 if law.inverse_actuation else largest,
            held=w_7 * _norm(own["G"] - own["v_ref_dot"]),
            moving=_moving_part_of_chi(k, w_8, run.z, own, _before(command)),
        )
        for name, stage in zip(STAGES, (kinematic, dynamic), strict=True):
            V, unit, left = found[f"V_{name}"], _norm(stage.n), found[f"left_{name}"]
            # of the tick's end, since the implicit form has the unit vector there
            end, off = _next(_norm(stage.s)), unit >= BALL
            gain = stage.c / stage.a * stage.least * (stage.held + stage.moving + stage.c_0)
            found |= {
                f"bound_{name}": stage.held + np.maximum(stage.moving, _next(stage.moving)),
                f"regularity_{name}": stage.least / stage.a,
                f"margin_{name}": gain / left,
                f"V_rate_{name}": np.where(off, (_next(V) - V) / run.dt, np.nan),
                f"V_rate_bound_{name}": np.where(off, -stage.c * stage.c_0 * end, np.nan),
                f"reaching_{name}": np.sqrt(2.0 * V * stage.weight) / (stage.c * stage.c_0),
                f"unit_{name}": unit,
            }
        found["stationarity"] = _norm(run.auxiliary_error)
    if law.inverse_actuation:
        found[_INVERSE] = found.pop("lambda_min_B")
    return {f"monitors/{name}": np.ascontiguousarray(found[name]) for name in sorted(found)}


_INVERSE = "lambda_min_M_inverse"


def _along(run: Run, law: Any, rows: _Rows, g: Array) -> dict[str, Array]:
    """Quantities of the matrices along the motion; NaN at ticks where one does not exist."""
    space, root = law.task_space(run.robot, run.task), np.sqrt(law.metric(run.robot))
    free = Jacobians(run.robot, run.task, run.criterion)
    plant, n, nz = run.plant, len(run.t), run.robot.nz
    names = [
        *("lambda_min_J", "lambda_min_B", "lambda_max_M", "left_kinematic", "left_dynamic"),
        *("V_kinematic", "V_dynamic", "drift", "stiffness"),
    ]
    found = {name: np.full(n, np.nan) for name in names}
    found["V_kinematic"][:] = 0.5 * _norm(rows.s) ** 2
    for first in range(0, n, _BLOCK):
        here = slice(first, min(first + _BLOCK, n))
        part = _Rows(*(values[here] for values in rows))
        size = len(part.t)
        J = np.full((size, space.p, nz), np.nan)
        jerk = np.zeros((size, space.p))
        M, B, M_rate = np.full((3, size, nz, nz), np.nan)
        for i, (t, q, z) in enumerate(zip(part.t, part.q, part.z, strict=True)):
            speed = max(_norm(z[None])[0], 1e-300)
            M[i], _, B[i] = plant.dynamics(q, z)
            M_rate[i] = speed * rate_along(plant, q, z / speed, plant.reduced_inertia)
            try:
                space.at(t, q, z)
                jerk[i, : space.p_d.shape[1]] = space.p_d[3]
                free.extended.at(q, z)
            except SingularityError:
                continue
            J[i] = space.J
            found["stiffness"][first + i] = free.stiffness()
        found["drift"][here] = _norm(g[here] - jerk)
        found["lambda_min_J"][here] = np.nan_to_num(_singular(J * root)[:, -1] ** 2)  # 0: no J
        found["left_kinematic"][here] = _norm(part.s_rate - _times(J, part.v_ref_dot))
        largest = _singular(M)[:, 0]
        driven = _times(B, part.v_dot)
        if law.inverse_actuation:
            found["lambda_min_B"][here] = 1.0 / largest
            rest = part.S_rate - _solved(M, driven)
            found["V_dynamic"][here] = 0.5 * _norm(part.S) ** 2
        else:
            found["lambda_min_B"][here] = _singular(B)[:, -1] ** 2
            rest = _times(M, part.S_rate) - driven + 0.5 * _times(M_rate, part.S)
            found["V_dynamic"][here] = 0.5 * np.sum(part.S * _times(M, part.S), axis=1)
        found["left_dynamic"][here] = _norm(rest)
        found["lambda_max_M"][here] = largest
    return found


def _moving_part_of_W(k: Mapping[str, Any], run: Run, v_ref: Array) -> Array:
    """(w_1 + w_2 |q - q_rest|) (w_3k |v_ref||z| + w_4k |z|^3) under (34)."""
    bound = k["w_1"] + k["w_2"] * _norm(run.q - run.robot.q_rest)
    size = _norm(run.z)
    return np.asarray(bound * (k["w_3k"] * _norm(v_ref) * size + k["w_4k"] * size**3))


def _moving_part_of_chi(
    k: Mapping[str, Any], w_8: float, z: Array, own: Mapping[str, Array], v: Array
) -> Array:
    """chi under (53) without its term of w_7."""
    size = _norm(z)
    return np.asarray(
        k["w_3"] * _norm(v) * size
        + k["w_4"] * size**3
        + k["w_5"] * size * (1.0 + k["beta_0"])
        + k["w_6"] * k["beta_1"]
        + w_8 * size * _norm(own["S"])
        + k["w_9"] * size * _norm(own["z_dot"])
    )


def _next(values: Array) -> Array:
    """Values of the tick after; NaN at the last."""
    return np.concatenate([values[1:], np.full_like(values[:1], np.nan)])


def _before(values: Array) -> Array:
    """Values of the tick before, 0 at the first."""
    return np.concatenate([np.zeros_like(values[:1]), values[:-1]])


def _norm(values: Array) -> Array:
    return np.asarray(np.sqrt(np.sum(values * values, axis=-1)))


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("kij,kj->ki", matrices, vectors))


def _singular(matrices: Array) -> Array:
    """Singular values, in falling order; NaN of matrices that are not finite."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    found = np.full((len(matrices), min(matrices.shape[1:])), np.nan)
    found[finite] = np.linalg.svd(matrices[finite], compute_uv=False)
    return found


def _solved(matrices: Array, vectors: Array) -> Array:
    """M^-1 x; NaN where one has no inverse."""
    try:
        return np.asarray(np.linalg.solve(matrices, vectors[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.full_like(vectors, np.nan)


# What failed ------------------------------------------------------------------------------------------


class Assumption(NamedTuple):
    """A condition of the theorems along a run: it fails where the ratio exceeds 1."""

    equation: str
    words: str
    ratio: Array
    """Shape (N,)."""


def assumptions(signals: Mapping[str, Array]) -> list[Assumption]:
    """(22), (54) or (64), (41) and (53) along a monitored run, from its record's signals."""
    own = {name.removeprefix("monitors/"): values for name, values in signals.items()}
    dynamic = ("(64)", "A' over lambda_min(M^-1)")
    if _INVERSE not in own:
        dynamic = ("(54)", "A over lambda_min(B B^T)")
    with np.errstate(all="ignore"):
        return [
            Assumption("(22)", "a over lambda_min(J J^T)", 1.0 / own["regularity_kinematic"]),
            Assumption(*dynamic, 1.0 / own["regularity_dynamic"]),
            *(
                Assumption(equation, words, bound_ratio(signals, stage))
                for stage, equation, words in (
                    ("kinematic", "(41)", "its left side over W"),
                    ("dynamic", "(53)", "its left side over chi"),
                )
            ),
        ]


def bound_ratio(signals: Mapping[str, Array], stage: str) -> Array:
    """The left side of (41), or (53), over what bounds it; NaN at the last tick."""
    return np.asarray(signals[f"monitors/left_{stage}"] / signals[f"monitors/bound_{stage}"])


def ratios_of(signals: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
    """The assumptions, which hold up to 1, and the margins, which suffice from 1 on, for figures: by the
    title of an axis and a name; none of a run that is not monitored."""
    if "monitors/margin_dynamic" not in signals:
        return {}
    return {
        "assumption holds up to 1": {item.equation: item.ratio for item in assumptions(signals)},
        MARGINS: {stage: signals[f"monitors/margin_{stage}"] for stage in STAGES},
    }


def first_failure(t: Array, signals: Mapping[str, Array]) -> str:
    """One line: which assumptions failed, the first one first, when, and by how much; and the margins.

    Args:
        t: Times of the samples (s), shape (N,).
        signals: Of the record of a monitored run.
    """
    failed, held = [], []
    for equation, words, ratio in assumptions(signals):
        known = ~np.isnan(ratio)
        beyond = np.flatnonzero(known & (ratio > 1.0))
        if len(beyond):
            share = 100.0 * len(beyond) / known.sum()
            text = f"{equation} at {t[beyond[0]]:.4g} s ({words} up to {ratio[beyond].max():.5g}, "
            failed.append((beyond[0], f"{text}in {share:.3g} % of the ticks)"))
        elif known.any():
            held.append(equation)
    failed.sort(key=lambda item: item[0])
    texts = [text for _, text in failed]
    first = f"first to fail is {', then '.join(texts)}"
    if not texts:
        first = f"{', '.join(sorted(held))} hold at every tick"
    margins = [(name, least_of(signals[f"monitors/margin_{name}"])) for name in STAGES]
    parts = [f"{least:.3g} ({name})" for name, least in margins if not math.isnan(least)]
    return first + (f"; margins of the gains at least {' and '.join(parts)}" if parts else "")


def least_of(values: Array) -> float:
    """The least value that is known; NaN if none is."""
    return float(np.nanmin(values)) if np.isfinite(values).any() else math.nan
