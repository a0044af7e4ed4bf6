"""Colours: distinguishable on light and dark backgrounds, also with red-green blindness."""

from itertools import combinations

import numpy as np
import pytest

from tautwave.canvas import (
    CONTACTS,
    DAMPER,
    DARK,
    FILTER,
    INK,
    LIMIT,
    LINE,
    MASTER,
    PAPER,
    SLAVE,
    SOFT,
    WALL,
    dark_rules,
    element_style,
)

DEVICES = {"master": MASTER, "slave": SLAVE, "wall": WALL}
LINES = {**DEVICES, "line": LINE, "filter": FILTER, "damper": DAMPER, "ink": INK}
# Machado, Oliveira and Fernandes 2009, severity 1, on linear RGB.
SIGHT = {
    "all": np.eye(3),
    "protan": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
         [-0.003882, -0.048116, 1.051998]]
    ),
    "deutan": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
         [-0.011820, 0.042940, 0.968881]]
    ),
    "tritan": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
         [0.004733, 0.691367, 0.303900]]
    ),
}  # fmt: skip
GROUNDS = ("light", "dark")


def shown(colour, ground):
    return DARK[colour] if ground == "dark" else colour


def linear(colour):
    part = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255.0
    return np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)


def lab(colour, sight):
    rgb = np.clip(SIGHT[sight] @ linear(colour), 0.0, 1.0)
    to_xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    t = to_xyz @ rgb / np.array([0.9505, 1.0, 1.089])
    f = np.where(t > 0.008856, np.cbrt(t), 7.787 * t + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def distance(one, two, sight="all"):
    """CIE 1976; 2.3 is what an eye can just tell."""
    return float(np.linalg.norm(lab(one, sight) - lab(two, sight)))


def contrast(one, two):
    """WCAG 2 ratio of luminances."""
    light, dark = sorted((0.2126, 0.7152, 0.0722) @ linear(c) + 0.05 for c in (one, two))[::-1]
    return light / dark


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("sight", SIGHT)
def test_devices_and_walls_are_distinguishable_to_everyone(ground, sight):
    for (_, one), (_, two) in combinations(DEVICES.items(), 2):
        assert distance(shown(one, ground), shown(two, ground), sight) > 15.0


@pytest.mark.parametrize("ground", GROUNDS)
def test_what_lines_are_of_is_distinguishable(ground):
    for (a, one), (b, two) in combinations(LINES.items(), 2):
        assert distance(shown(one, ground), shown(two, ground)) > 20.0, (a, b)


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("sight", SIGHT)
def test_no_contact_is_taken_for_a_device_or_a_wall(ground, sight):
    for contact in CONTACTS:
        for device in (SLAVE, WALL):  # what a contact is between
            assert distance(shown(contact, ground), shown(device, ground), sight) > 25.0
        assert distance(shown(contact, ground), shown(MASTER, ground)) > 25.0
    for one, two in combinations(CONTACTS, 2):
        assert distance(shown(one, ground), shown(two, ground), sight) > 7.0


@pytest.mark.parametrize("ground", GROUNDS)
def test_what_is_drawn_stands_out_from_the_ground(ground):
    paper = shown(PAPER, ground)
    for colour in (INK, SOFT):
        assert contrast(shown(colour, ground), paper) >= 4.5  # words
    for colour in (*DEVICES.values(), LINE, LIMIT, *CONTACTS[1:]):
        assert contrast(shown(colour, ground), paper) >= 3.0  # lines
    for colour in (*LINES.values(), *CONTACTS):
        assert contrast(shown(colour, ground), paper) >= 2.0


def test_a_dark_page_has_a_rule_for_every_colour():
    rules = dark_rules("figure")
    for light, dark in DARK.items():
        for what in ("fill", "stroke"):
            one = f'[{what}="{light}"]'
            assert f"figure {one}, path{one} {{ {what}: {dark}; }}" in rules
    assert len(set(DARK)) == len(set(DARK.values())) == len(DARK)


def test_dashes_are_the_slaves_unless_a_colour_of_its_own_says_so():
    master, slave = element_style("port_master"), element_style("port_slave")
    assert master == {"color": MASTER, "linestyle": "-"}
    assert slave == {"color": SLAVE, "linestyle": "-"}
    assert element_style("wall_master") == {"color": WALL, "linestyle": "-"}
    assert element_style("wall_slave") == {"color": WALL, "linestyle": "--"}
    assert element_style("line") == {"color": LINE, "linestyle": "-"}
    assert element_style("what_is_new") == {"color": SOFT, "linestyle": "-"}
