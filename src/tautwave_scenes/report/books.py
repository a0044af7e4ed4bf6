"""The energy books of a scene, as totals and by element."""

from __future__ import annotations

import math

import numpy as np

from tautwave.certificate.belief import declared_delays
from tautwave.config import Rig
from tautwave.report.figures.envelope import Floats
from tautwave.report.run.rundir import Run
from tautwave.report.run.tables import MAX_ELEMENTS
from tautwave.report.units import quantity
from tautwave.tables import Table, of_numbers
from tautwave_scenes.rig.network import hold_claim, hold_limit


def scene_books(run: Run) -> dict[str, float | None]:
    """Totals of a scene's books [J]: gross flow, residual, and what was fed into it.

    `generated` is the energy from negative dampers and sources, what held efforts gave back beyond
    what the devices put in, and what the scheme itself created.
    """
    names = ("residual", "hold", "made", "numeric", "pumped", "kinetic", "stored")
    read = {name: run.read(f"scene.{name}").get(f"scene.{name}") for name in names}
    known = {name: values for name, values in read.items() if values is not None}
    gross = sum(
        float(v[-1]) for p in run.ports for v in run.read(f"master.{p}.gross_flow").values()
    )
    for name in ("pumped", "made"):
        if name in known:
            gross += float(np.abs(np.diff(known[name])).sum())
    inside = [known[name] for name in ("kinetic", "stored") if name in known]
    if inside:
        gross += float(np.max(np.sum(inside, axis=0)))
    residual = float(np.max(np.abs(known["residual"]))) if "residual" in known else 0.0
    fed = float(known["made"][-1]) if "made" in known else 0.0
    for name, sign in (("hold", -1.0), ("numeric", 1.0)):
        if name in known:
            fed += max(0.0, float(np.max(sign * known[name])))
    return {
        "gross_flow": gross,
        "residual": residual if np.isfinite(residual) else None,
        "generated": fed,
    }


def scene_table(run: Run) -> Table:
    """The account of every mass, link, port and string of a scene at the end of the run."""
    elements = {} if run.result.scene is None else run.result.scene.elements
    keys = ("kinetic", "stored", "lost", "made", "pumped", "work", "numeric")
    rows = []
    touched = {
        name: account for name, account in elements.items() if any(account.get(key) for key in keys)
    }
    for name, account in list(touched.items())[:MAX_ELEMENTS]:
        cells = [quantity(account[key], "J", 3) if account.get(key) else "–" for key in keys]
        rows.append((name, *cells))
    more = len(elements) - len(rows)
    heads = ("kinetic", "stored", "lost", "fed", "external force", "port", "by the scheme")
    return Table(
        "Scene, by element",
        of_numbers("element", *heads),
        tuple(rows),
        f"{more} more, {len(elements) - len(touched)} of them without energy, are in summary.json."
        if more > 0
        else "",
    )


def given(run: Run) -> Floats | None:
    """Return what held efforts gave to the network [J], (rows,); None where rows do not say."""
    hold = run.read("scene.hold").get("scene.hold")
    return None if hold is None else -hold


def claim(rig: Rig) -> float:
    """Return what held efforts may give until their guard has stopped the run [J]."""
    names = [name.partition(".")[2] for name in rig.axes]
    most = hold_claim(rig, names, declared_delays(rig))
    return most if math.isfinite(most) else hold_limit(rig, names)
