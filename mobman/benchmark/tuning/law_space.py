"""The search space of a controller: what its suite says, or what is declared for its law."""

from __future__ import annotations

from pathlib import Path

from pydantic import RootModel

from mobman.benchmark.tuning.search_range import Space
from mobman.controllers.protocol import controllers, gains_by_field
from mobman.errors import SpecError, UsageError
from mobman.toml_model import read_toml, validate


class _Declared(RootModel[Space]):
    """A space as a file has it."""


def law_space(law: str) -> Space | None:
    """The space that is declared for a law: ``spaces/LAW.toml``, or its attribute ``search_space``.

    Args:
        law: Name of a controller.

    Returns:
        Ranges by gain; None if nothing is declared.

    Raises:
        SpecError: If the declaration is not valid.
    """
    own = getattr(controllers.get(law), "search_space", None)
    if own is not None:
        where = f"search_space of the controller {law!r}"
        return checked_space(law, validate(_Declared, own, where).root, where)
    files = {path.stem: path for path in (Path(__file__).parent / "spaces").glob("*.toml")}
    if law not in files:
        return None
    where = str(files[law])
    space = validate(_Declared, read_toml(files[law], "search space"), where).root
    return checked_space(law, space, where)


def checked_space(law: str, space: Space, where: str) -> Space:
    """A space by the names of the gains' fields.

    Args:
        law: Name of the controller.
        space: Ranges by gain; underscores may be left out.
        where: What to call it in messages.

    Raises:
        SpecError: If it is empty, or the law has no such gain.
    """
    if not space:
        raise SpecError(
            f"{where} has no gain; give at least one, such as K_p = {{ low, high, log }}"
        )
    try:
        return gains_by_field(law, space)
    except UsageError as error:
        raise SpecError(f"{where}: {error}") from error
