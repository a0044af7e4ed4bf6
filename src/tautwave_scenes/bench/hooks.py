"""Measurements of a rig with a scene: what `tautwave.bench.hooks` asks for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tautwave.bench.extremes import DECADES, SIZES, each, has, rates
from tautwave.bench.precision.points import Scene
from tautwave.bench.precision.suite import ROUNDS
from tautwave.bench.result import Group
from tautwave.config import Rig
from tautwave.errors import ConfigError
from tautwave.simulation.rows import Simulation
from tautwave_scenes.bench.precision import SceneRig, network_scene

SPAN_S = {False: 0.2, True: 0.5}
"""So much of a scene is measured [s]: with contacts, any two runs diverge sooner or later."""


def precision(
    rig: Rig, path: Path, changes: tuple[str, ...], full: bool, begin_s: float, max_error: float
) -> Scene:
    """Return every scheme on a rig's scene along its hand."""
    left = rig.duration_s - begin_s
    if not left > 0.0:
        raise ConfigError(
            f"--begin {begin_s:g}: {path} lasts for {rig.duration_s:g} s; give less than that"
        )
    span_s = min(SPAN_S[full], left)
    scene = SceneRig(rig.name, path, begin_s, span_s, "the scene along its hand", changes)
    return network_scene(scene, full, max_error, ROUNDS[full])


def extremes(rig: Rig) -> Iterator[Group]:
    """Yield what the masses, links and ports of a scene may be."""
    assert rig.scene is not None
    for block, key, values, what in (
        ("links", "stiffness", DECADES, "stiffness of links, 1 to 1e9"),
        ("links", "damping", SIZES, "damping of links, 0 to 1e4"),
        ("ports", "stiffness", DECADES, "stiffness of ports, 1 to 1e9"),
        ("masses", "mass", (1e-9, 1e-6, 1e-3, 1.0, 1e3), "mass of masses, 1e-9 to 1e3"),
        ("masses", "damping", SIZES, "damping of masses, 0 to 1e4"),
    ):
        parts: Mapping[str, Any] = getattr(rig.scene, block, None) or {}
        keys = [f"scene.{block}.{name}.{key}" for name, part in parts.items() if has(part, key)]
        if keys:
            yield Group(what, each(values, *keys))
    yield from rates(())


def books(made: Simulation) -> tuple[float, float]:
    """Return residual and energy that the scheme created [J]."""
    residual = float(np.abs(made["scene.residual"]).max())
    return residual, max(0.0, float(made["scene.numeric"].max()))
