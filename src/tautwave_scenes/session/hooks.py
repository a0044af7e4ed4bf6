"""A scene from check to summary: what `tautwave.session.hooks` asks for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tautwave.config import Rig
from tautwave.rig import Assembly
from tautwave.types import CommandDelay
from tautwave_scenes.config.keys import Scene
from tautwave_scenes.rig.network import hold_claim, keys_of, scheme_choice
from tautwave_scenes.rig.network import keep_sounds as keep_files
from tautwave_scenes.runtime.axes import SceneControl
from tautwave_scenes.session.pace import choose_engine, hold_fact, pace_fact, use_engine
from tautwave_scenes.session.plan import plan, solid_facts, tissue_facts

__all__ = [
    "choose_engine",
    "facts",
    "keep_files",
    "plan",
    "prompt_claim",
    "summary",
    "use_engine",
    "words",
]


def words(rig: Rig) -> str:
    """Return what stands in place of a coupling: the scheme, and whether `auto` chose it."""
    if isinstance(rig.scene, Scene) and rig.scene.scheme == "auto":
        scheme = f"{scheme_choice(rig).scheme} (auto)"
    else:
        scheme = keys_of(rig).scheme
    return f"none: the master's axes touch a scene, scheme {scheme}"


def facts(rig: Rig, *, brief: bool) -> list[tuple[str, str]]:
    """Return what tissues weigh, the cost of a cycle, and the bound on held efforts' energy.

    `brief` leaves out the cost, for which a hundred cycles have to be run.
    """
    tissues = [(f"tissue {name}", text) for name, text in tissue_facts(rig)]
    tissues += [(f"solid {name}", text) for name, text in solid_facts(rig)]
    if not brief:
        tissues.append(("scene time", pace_fact(rig)))
    return [*tissues, ("scene limit", hold_fact(rig))]


def prompt_claim(rig: Rig, delays: Mapping[str, CommandDelay]) -> float:
    """Return the most that the held efforts of all ports give before a run has stopped [J]."""
    return hold_claim(rig, [name.partition(".")[2] for name in rig.axes], delays)


def summary(assembly: Assembly, engine: str) -> dict[str, Any]:
    """Return the engine, and what every element of the network took and gave."""
    assert isinstance(assembly.control, SceneControl)
    return {"engine": engine, "elements": assembly.control.scene.model.elements()}
