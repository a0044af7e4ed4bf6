"""What a run with arms leaves: a still in the page, arms.gif beside it."""

from __future__ import annotations

from collections.abc import Iterator

from tautwave.report.html import image
from tautwave.report.run.parts import File, Part, Still
from tautwave.report.run.rundir import Run
from tautwave.summary.markup import Markup

FILE = "arms.gif"


def has_arms(run: Run) -> bool:
    """Return whether a run's rig has arms, by its text alone: most runs load nothing here."""
    sides = (run.rig.get(side) for side in ("master", "slave"))
    buses = run.rig.get("buses")
    tips = buses.values() if isinstance(buses, dict) else ()
    own = (side.get(key) for side in sides if isinstance(side, dict) for key in ("arm", "arms"))
    return any(own) or any(isinstance(bus, dict) and bus.get("driver") == "arm" for bus in tips)


def write_arms(run: Run) -> None:
    """Write arms.gif into the directory of a run that had arms; else nothing."""
    if not has_arms(run):
        return
    from tautwave.report.arms.drawing import write_arms_animation
    from tautwave.report.arms.view import view_arms

    view = view_arms(run)
    if view is not None:
        write_arms_animation(view, run.directory / FILE)


def arm_parts(run: Run) -> Iterator[Part]:
    """Yield a still of a run's arms and their animation."""
    from tautwave.report.arms.drawing import arms_still
    from tautwave.report.arms.view import view_arms

    view = view_arms(run)
    if view is None:
        return
    yield Markup('<h2 id="arms">Arms</h2>')
    caption = "The arms where most force was at their tips"
    if not any(arm.forces for arm in view.arms):
        caption = "The arms where the leader reaches farthest"
    alt = "the arms of the run, with walls in space and the forces at their tips"
    yield Still("arms-still", arms_still(view, False), arms_still(view, True), alt, f"{caption}.")
    moving = run.directory / FILE
    if moving.is_file():
        yield Markup("<details><summary>The arms, moving</summary>")
        yield File(moving, lambda data: image(data, "gif", "the arms, moving"), "The arms, moving")
        yield Markup("</details>")
