"""Check of what the URDFs state and the equations do not take."""

from __future__ import annotations

from collections.abc import Iterator

from mobman.checks.checks import Remark, all_ok, check, ok, some, warning
from mobman.checks.subject import Subject


@check("urdf", "everything that the URDFs state is taken, or said to be left out")
def urdf(subject: Subject) -> Iterator[Remark]:
    for file in subject.robot.urdf.files:
        for remark in file.remarks:
            yield warning(f"{file.path.name}, {remark}", "correct it there, if it is to be drawn")
        if stated := file.friction:
            yield ok(
                f"{file.path.name} gives damping or friction to {len(stated)} joints "
                f"({some(stated)}): the equations leave them out, the scenario 'urdf-friction' has them"
            )
    yield all_ok("nothing is left out")
