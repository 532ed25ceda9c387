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
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from mobman.arrays import Array
from mobman.controllers.bounds import rate_along
from mobman.controllers.protocol import controllers
from mobman.errors import SingularityError, UsageError
from mobman.simulation.metrics import Function, Run, metric
from mobman.simulation.singularity import Jacobians

STAGES = ("kinematic", "dynamic")
_BLOCK = 1000  # ticks whose matrices are in memory together
MARGINS = "margin of the gain"
BALL = 1.0 - 1e-9
"""|n| from which on the state is off the manifold."""
_INVERSE = "lambda_min_M_inverse"


def require_monitored(law: Any) -> None:
    """Raise UsageError if a law has no sliding variables that the theorems are about."""
    if not hasattr(law, "monitored_signals"):
        laws = controllers.loaded().items()
        having = ", ".join(sorted(name for name, own in laws if hasattr(own, "monitored_signals")))
        name = getattr(law, "name", type(law).__name__)
        raise UsageError(
            f"monitor: the controller {name!r} has no sliding variables s (31) and S (51); "
            f"allowed: {having}"
        )


# Along the run ----------------------------------------------------------------------------------------


def monitors(run: Run, law: Any, signals: Mapping[str, Array], command: Array) -> dict[str, Array]:
    """The monitors of a run at its ticks, by their places in the record, from its law, the law's
    ``monitored_signals()`` and the commanded torque, N rows each; the last tick has no rates."""
    k, inverse = law.settings(), law.inverse_actuation
    own = {name.removeprefix("sliding/"): values for name, values in signals.items()}
    with np.errstate(all="ignore"):  # of a run that diverged
        found = _along(run, law, own)
        z, heaviest = _norm(run.z), np.nanmax(found.pop("lambda_max_M"), initial=0.0)
        bound = k["w_1"] + k["w_2"] * _norm(run.q - run.robot.q_rest)  # of (34)
        v_ref, v = _norm(_before(own["v_ref"])), _norm(_before(command))
        w_7, w_8 = (1.0, 0.0) if inverse else (k["w_7"], k["w_8"])  # chi' under (66)
        chi = (
            k["w_3"] * v * z
            + k["w_4"] * z**3
            + k["w_5"] * z * (1.0 + k["beta_0"])
            + k["w_6"] * k["beta_1"]
            + w_8 * z * _norm(own["S"])
            + k["w_9"] * z * _norm(own["z_dot"])
        )
        # of each stage: gains, lambda_min that a (or A) bounds, largest lambda_max(M) of Theorem 2, and
        # of W (or chi) the part that the law holds over a tick, and the rest
        stages = {
            "kinematic": (
                *(k["c"], k["c_0"], k["a"], found["lambda_min_J"], own["s"], own["n"], 1.0),
                *(found.pop("drift"), bound * (k["w_3k"] * v_ref * z + k["w_4k"] * z**3)),
            ),
            "dynamic": (
                *(k["C"], k["C_0"], k["A"], found["lambda_min_B"], own["S"], own["n_d"]),
                *(1.0 if inverse else heaviest, w_7 * _norm(own["G"] - own["v_ref_dot"]), chi),
            ),
        }
        for name, (c, c_0, a, least, s, n, largest, held, moving) in stages.items():
            V, unit = found[f"V_{name}"], _norm(n)
            # of the tick's end, since the implicit form has the unit vector there
            end, off = _next(_norm(s)), unit >= BALL
            found |= {
                f"bound_{name}": held + np.maximum(moving, _next(moving)),
                f"regularity_{name}": least / a,
                f"margin_{name}": c / a * least * (held + moving + c_0) / found[f"left_{name}"],
                f"V_rate_{name}": np.where(off, (_next(V) - V) / run.dt, np.nan),
                f"V_rate_bound_{name}": np.where(off, -c * c_0 * end, np.nan),
                f"reaching_{name}": np.sqrt(2.0 * V * largest) / (c * c_0),
                f"unit_{name}": unit,
            }
        found["stationarity"] = _norm(run.auxiliary_error)
    if inverse:
        found[_INVERSE] = found.pop("lambda_min_B")
    return {f"monitors/{name}": np.ascontiguousarray(found[name]) for name in sorted(found)}


def _along(run: Run, law: Any, own: Mapping[str, Array]) -> dict[str, Array]:
    """Quantities of the matrices along the motion; NaN at ticks where one does not exist."""
    space, root = law.task_space(run.robot, run.task), np.sqrt(law.metric(run.robot))
    free = Jacobians(run.robot, run.task, run.criterion)
    plant, n, nz, s, S = run.plant, len(run.t), run.robot.nz, own["s"], own["S"]
    s_rate, S_rate = (_next(s) - s) / run.dt, (_next(S) - S) / run.dt
    found = {
        name: np.full(n, np.nan)
        for name in (
            *("lambda_min_J", "lambda_min_B", "lambda_max_M", "left_kinematic", "left_dynamic"),
            *("V_dynamic", "drift", "stiffness"),
        )
    }
    found["V_kinematic"] = 0.5 * _norm(s) ** 2
    for first in range(0, n, _BLOCK):
        here = slice(first, min(first + _BLOCK, n))
        size = here.stop - first
        J, jerk = np.full((size, space.p, nz), np.nan), np.zeros((size, space.p))
        M, B, M_rate = np.full((3, size, nz, nz), np.nan)
        for i, (t, q, z) in enumerate(zip(run.t[here], run.q[here], run.z[here], strict=True)):
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
        found["drift"][here] = _norm(own["g"][here] - jerk)
        found["lambda_min_J"][here] = np.nan_to_num(_singular(J * root)[:, -1] ** 2)  # 0: no J
        found["left_kinematic"][here] = _norm(s_rate[here] - _times(J, own["v_ref_dot"][here]))
        found["lambda_max_M"][here] = heaviest = _singular(M)[:, 0]
        driven = _times(B, own["v_dot"][here])
        if law.inverse_actuation:
            found["lambda_min_B"][here] = 1.0 / heaviest
            rest = S_rate[here] - _solved(M, driven)
            found["V_dynamic"][here] = 0.5 * _norm(S[here]) ** 2
        else:
            found["lambda_min_B"][here] = _singular(B)[:, -1] ** 2
            rest = _times(M, S_rate[here]) - driven + 0.5 * _times(M_rate, S[here])
            found["V_dynamic"][here] = 0.5 * np.sum(S[here] * _times(M, S[here]), axis=1)
        found["left_dynamic"][here] = _norm(rest)
    return found


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
    dynamic = ("(54)", "A over lambda_min(B B^T)")
    if _INVERSE in own:
        dynamic = ("(64)", "A' over lambda_min(M^-1)")
    with np.errstate(all="ignore"):
        return [
            Assumption("(22)", "a over lambda_min(J J^T)", 1.0 / own["regularity_kinematic"]),
            Assumption(*dynamic, 1.0 / own["regularity_dynamic"]),
            Assumption("(41)", "its left side over W", bound_ratio(signals, "kinematic")),
            Assumption("(53)", "its left side over chi", bound_ratio(signals, "dynamic")),
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
    """One line of a monitored run's times (s), shape (N,), and signals: which assumptions failed, the
    first one first, when, and by how much; and the margins."""
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


# Metrics ----------------------------------------------------------------------------------------------


def _add_metrics(stage: str) -> None:
    """Register the metrics of a stage: how far what the theorems suppose was from failing."""

    def add(
        name: str, unit: str, description: str, better: str = "lower"
    ) -> Callable[[Function], Function]:
        return metric(
            *(f"{name}_{stage}", unit, f"{stage} stage: {description}", better),
            section="theorems",
            applies=lambda run: "monitors/margin_dynamic" in run.signals,
        )

    def of(run: Run, name: str) -> Array:
        return run.signals[f"monitors/{name}_{stage}"]

    add("gain_margin", "1", "least of what the gain gives over what is needed", "higher")(
        lambda run: least_of(of(run, "margin"))
    )
    add("regularity", "1", "least lambda_min of (22), (54) or (64) over a or A", "higher")(
        lambda run: least_of(of(run, "regularity"))
    )
    add("bound_ratio", "1", "largest left side of (41) or (53) over W or chi")(
        lambda run: float(np.nanmax(bound_ratio(run.signals, stage), initial=0.0))
    )
    add("bound_exceeded", "1", "share of the ticks at which (41) or (53) does not hold")(
        lambda run: float(np.mean(bound_ratio(run.signals, stage) > 1.0))
    )
    add("off_manifold", "1", "share of the ticks at which the unit vector is not inside its ball")(
        lambda run: float(np.mean(of(run, "unit") >= BALL))
    )
    add("reaching_bound", "s", "time by which it is, by Theorem 1, 2 or 4", "")(
        lambda run: float(of(run, "reaching")[0])
    )

    @add("decrease_missed", "1", "share of those at which V falls more slowly than (42) or (63)")
    def _(run: Run) -> float:
        rate, bound = of(run, "V_rate"), of(run, "V_rate_bound")
        known = np.isfinite(rate)
        return float(np.mean(rate[known] > bound[known])) if known.any() else 0.0

    @add("reaching_time", "s", "first time on the manifold; inf if it is not reached")
    def _(run: Run) -> float:
        """The unit vector is inside its ball, or the sliding variable has turned."""
        s = run.signals["sliding/s" if stage == "kinematic" else "sliding/S"]
        turned = np.append(False, np.sum(s[1:] * s[:-1], axis=1) <= 0.0)
        reached = np.flatnonzero(turned | (of(run, "unit") < BALL))
        return float(run.t[reached[0]]) if len(reached) else math.inf


for _stage in STAGES:
    _add_metrics(_stage)
