"""Access of the goldens to mobman beyond its public interface.

A change of mobman's modules or of names that are not in the public contract changes this file alone.
"""

from __future__ import annotations

import contextlib
import dataclasses
import sys
from collections.abc import Mapping, Sequence
from typing import Any
from unittest.mock import patch

import numpy as np

import mobman as mm
from mobman.registry import Registry
from mobman.robots import catalogue
from support.task_errors import errors_of


@contextlib.contextmanager
def only_mobmans_own():
    """Nothing is registered but what mobman brings: other tests of this process may have added to it."""
    with contextlib.ExitStack() as stack:
        modules = [module for name, module in sys.modules.items() if name.startswith("mobman.")]
        # once each, wherever it is imported
        registries = {
            id(thing): thing
            for module in modules
            for thing in vars(module).values()
            if isinstance(thing, Registry)
        }
        for registry in registries.values():
            stack.enter_context(patch.object(registry, "_items", {}))
        stack.enter_context(patch.object(catalogue, "_registered", {}))
        yield


def model_terms(robot, q, z, q_dot, multiplier) -> dict[str, Any]:
    """Every public method of a robot that takes q or (q, z), by its name, as arrays."""
    dynamics, velocity = robot.dynamics(q, z), robot.velocity(q, z)
    kinematics = robot.tip_kinematics(q, z)
    return {
        "checked_configuration": robot.checked_configuration(robot.consistent(q)),
        "constraint_matrix": robot.constraint_matrix(q),
        "constraint_matrix_rate": robot.constraint_matrix_rate(q, q_dot),
        "constraint_hessian": robot.constraint_hessian(q, multiplier),
        "constraint_hessian_rate": robot.constraint_hessian_rate(q, q_dot, multiplier),
        "velocity_map": robot.velocity_map(q),
        "velocity_map_rate": robot.velocity_map_rate(q, z),
        "velocity": {"C": velocity.C, "q_dot": velocity.q_dot, "C_dot_z": velocity.C_dot_z},
        "actuation": robot.actuation(q),
        "reduced_inertia": robot.reduced_inertia(q),
        "dynamics": {"M": dynamics.M, "bias": dynamics.bias, "B": dynamics.B},
        "gravity": robot.dynamics(q, np.zeros(robot.nz)).bias,
        "motor_inertia": robot.motor_inertia(q),
        "energy": robot.energy(q, z),
        "tip_pose": robot.tip_pose(q).homogeneous,
        "arm_origin": robot.arm_origin(q),
        "consistent": robot.consistent(q),
        "tip_jacobian": robot.tip_jacobian(q),
        "tip_kinematics": {
            "position": kinematics.position,
            "jacobian": kinematics.jacobian,
            "jacobian_rate": kinematics.jacobian_rate,
        },
    }


def robot_constants(robot) -> dict[str, Any]:
    """Constants of a robot."""
    limits = robot.limits
    return {
        "q_rest": robot.q_rest,
        "criterion_weights": robot.criterion_weights,
        "criterion_couplings": robot.criterion_couplings,
        "limits": {name: getattr(limits, name) for name in limits._fields},
    }


def smallest_argument(law, step) -> float:
    """Make a step of a sliding law: the smallest argument of a fractional power in it.

    These are e, e', e'' and the inner bracket of (31), E and E' of (51), in every component.

    Args:
        law: The law.
        step: Arguments of its ``step``.
    """
    _, _, z, z_dot = step
    v_ref, integral_v_ref = law._held.v_ref.copy(), law._held.integral_v_ref.copy()
    law.step(*step)
    errors = errors_of(law._space, z)
    e_ddot = errors.J @ v_ref + errors.J_dot_z - errors.p_ddot
    power = np.sign(errors.e_dot) * np.abs(errors.e_dot) ** (9 / 7)
    inner = power + np.asarray(law.gains.lambda_0) ** (9 / 7) * errors.e
    arguments = (errors.e, errors.e_dot, e_ddot, inner, z - integral_v_ref, z_dot - v_ref)
    return min(float(np.abs(argument).min()) for argument in arguments)


def metrics_of(record: mm.Record, *, work: float, constraint_residual: float, limited=None):
    """Metrics of a record's samples.

    Args:
        record: At full rate; its robot is the plant, and its task has its default parameters.
        work: Work done on the plant (J).
        constraint_residual: Largest residual of the constraints (m/s).
        limited: At which ticks the torque was cut.
    """
    from mobman.model.criterion import Posture
    from mobman.model.task_map import TaskMap
    from mobman.simulation.metrics import Run, compute_metrics

    robot = mm.load_robot(record.robot)
    run = Run(
        completed=record.ok,
        duration=float(record.t[-1]),
        dt=float(record.t[1]),
        t=record.t,
        q=record.q,
        z=record.z,
        torque=record.torque,
        task_error=record.task_error,
        auxiliary_error=record.auxiliary_error,
        compute_time=record.compute_time,
        work=work,
        constraint_residual=constraint_residual,
        robot=robot,
        plant=robot,
        task=mm.make_task(record.task, robot, record.q[0]),
        task_map=TaskMap(),
        criterion=Posture.of(robot),
        limited=np.zeros(len(record.t), dtype=bool) if limited is None else limited,
        velocity_ratio=np.zeros(len(record.t)),
    )
    return compute_metrics(run)


def statistics_of(
    labels: Sequence[str], scores: np.ndarray, solved: np.ndarray, strata: Sequence[str]
) -> dict[str, Any]:
    """All statistics of a table of scores.

    Args:
        labels: Names of the rows.
        scores: Errors, inf for a failure, shape (labels, cells).
        solved: Which cells are solved, of the same shape.
        strata: What stratum each cell is in.
    """
    from mobman.benchmark import statistics

    best = float(scores[np.isfinite(scores)].min())
    taus = best * np.logspace(0, 4, 9)
    found: dict[str, Any] = {}
    for name, options in {"all": {}, "strata": {"strata": strata}}.items():
        found[name] = {
            "median": [statistics.median(row, scale="log10", **options) for row in scores],
            "interquartile_mean": [
                statistics.interquartile_mean(row, scale="log10", **options) for row in scores
            ],
            "score_profile": [statistics.score_profile(row, taus, **options) for row in scores],
            "ranking": statistics.ranking(labels, scores, **options),
            "pairs": statistics.compare_all(labels, scores, **options),
            "comparison": statistics.compare(scores[0], scores[1], **options),
        }
    found["linear"] = {
        "median": statistics.median(scores[0]),
        "interquartile_mean": statistics.interquartile_mean(scores[0]),
    }
    found["performance_profile"] = statistics.performance_profile(scores, np.logspace(0, 4, 9))
    found["proportion"] = [statistics.proportion(int(row.sum()), len(row)) for row in solved]
    found["successes"] = [statistics.compare_successes(solved[0], other) for other in solved[1:]]
    found["holm"] = statistics.adjust([0.01, 0.04, 0.03, 0.5])
    return _fields(found)


def _fields(value: Any) -> Any:
    """Dataclasses as dictionaries."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            field.name: _fields(getattr(value, field.name)) for field in dataclasses.fields(value)
        }
    if isinstance(value, Mapping):
        return {key: _fields(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_fields(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
