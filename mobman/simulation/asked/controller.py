"""The controller of a run: its law by name, and its gains as they were given."""

from __future__ import annotations

import inspect
from typing import Any

from mobman.controllers.gains import as_settings
from mobman.controllers.protocol import Controller, controllers, make_controller
from mobman.errors import MobmanError, RecordError, UnknownNameError
from mobman.simulation.asked.values import NotPlainError, as_plain


def controller_asked(given: Controller | str, controller: Controller) -> tuple[dict[str, Any], str]:
    """What a record keeps of the controller.

    Args:
        given: As :func:`mobman.simulate` was given it.
        controller: The object that ran.

    Returns:
        ``law``, the registered name or None, and ``gains``, before "auto" became numbers; and why the
        controller cannot be made again from these, empty if it can.
    """
    law = type(controller)
    name = given if isinstance(given, str) else _name_of(law, controller)
    gains: dict[str, Any] = {}
    problem = ""
    if name is None:
        problem = (
            f"its controller is an object of the class {law.__name__}, which is not registered"
        )
    elif hasattr(law, "Gains"):
        gains, problem = _gains(law, controller)
    elif not isinstance(given, str) and _parameters(law):
        problem = (
            f"its controller is an object of the class {law.__name__}, which takes parameters but "
            "declares no Gains"
        )
    return {"law": name, "gains": gains}, problem


def controller_again(spec: dict[str, Any]) -> Controller:
    """The controller of a run.

    Raises:
        RecordError: If there is no such law here, or it has other gains.
    """
    try:
        return make_controller(str(spec["law"]), **spec["gains"])
    except MobmanError as error:
        raise RecordError(f"its controller cannot be made: {error}") from error


def _name_of(law: type[Any], controller: Controller) -> str | None:
    """The name that a class is registered under; its own where it has several."""
    own = str(getattr(controller, "name", ""))
    try:
        if own and controllers.get(own) is law:
            return own
    except UnknownNameError:
        pass
    return next((name for name, item in controllers.loaded().items() if item is law), None)


def _gains(law: type[Any], controller: Controller) -> tuple[dict[str, Any], str]:
    given = getattr(controller, "gains", None)
    if not isinstance(given, law.Gains):
        return {}, f"its controller, a {law.__name__}, does not say its gains"
    try:
        settings = as_settings(given)
        gains: dict[str, Any] = as_plain(settings, lambda _: False)["dict"]
        again = as_settings(law.Gains(**settings)) == settings
    except (NotPlainError, MobmanError, TypeError, ValueError) as error:
        return {}, f"the gains of its controller, a {law.__name__}, are more than numbers: {error}"
    if not again or gains != settings:
        return {}, f"the gains of its controller, a {law.__name__}, are more than numbers"
    return settings, ""


def _parameters(law: type[Any]) -> list[str]:
    try:
        return list(inspect.signature(law).parameters)
    except (TypeError, ValueError):  # classes of other languages have no signature
        return []
