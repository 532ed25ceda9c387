"""Colours of laws: the same everywhere, and different within a figure."""

from __future__ import annotations

from mobman.figures.looks import LAWS, colours, looks_of, motor_looks


def test_a_law_has_one_colour_whatever_else_is_drawn():
    labels = {law: law for law in LAWS}
    assert {law: look.colour for law, look in looks_of(labels).items()} == LAWS
    for law in LAWS:
        assert looks_of({law: law})[law].colour == LAWS[law]
        assert looks_of({"mine": "mine", "renamed": law})["renamed"].colour == LAWS[law]


def test_laws_without_a_colour_of_their_own_get_others():
    found = colours(["mine", "tsm", "yours", "mine"])
    assert found[1] == LAWS["tsm"]
    assert found[0] == found[3]
    assert len({*found}) == 3


def test_two_labels_of_one_law_differ():
    looks = looks_of({"a": "tsm", "b": "tsm", "c": "pseudo-inverse"})
    assert looks["a"].colour == LAWS["tsm"]
    assert looks["c"].colour == LAWS["pseudo-inverse"]
    assert len({(look.colour, look.dashes) for look in looks.values()}) == 3


def test_explicit_and_tuned_labels_have_the_colour_of_what_they_come_from():
    laws = {
        "tsm": "tsm",
        "tsm explicit": "tsm",
        "pinv": "pseudo-inverse",
        "pinv+": "pseudo-inverse",
    }
    looks = looks_of(laws, {"tsm explicit"}, {"pinv+": "pinv"})
    assert looks["tsm explicit"].colour == looks["tsm"].colour
    assert looks["pinv+"].colour == looks["pinv"].colour
    assert looks["pinv+"].dashes != looks["pinv"].dashes
    # what chatters is drawn beneath the others, and the wide beneath the thin
    assert min(looks, key=lambda label: looks[label].depth) == "tsm explicit"


def test_curves_that_coincide_differ_in_width():
    widths = [look.width for look in looks_of({law: law for law in LAWS}).values()]
    assert widths[0] > widths[1] > widths[2]
    assert widths[3] > widths[4] > widths[5]


def test_sixty_motors_differ():
    assert len(set(motor_looks([f"y_{i}" for i in range(60)]).values())) == 60
