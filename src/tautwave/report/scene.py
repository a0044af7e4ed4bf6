"""What a run with a scene leaves beside its report: an animation and a sound."""

from __future__ import annotations

from pathlib import Path

from tautwave.report.loading import load_run
from tautwave.report.rundir import Run, is_space


def write_scene(directory: Path) -> None:
    """Write scene.gif and output.wav into the directory of a run that had a scene; else nothing.

    Raises
    ------
    RecordingError
        There is neither a summary nor a readable recording.
    """
    run = load_run(directory)
    if not run.ports:
        return
    if is_space(run):
        _write_space(run)
        return
    from tautwave.report.scene_drawing import write_animation
    from tautwave.report.scene_sound import write_sound
    from tautwave.report.scene_view import view_scene

    view = view_scene(run)
    if view is None or not view.efforts or len(view.time) < 2:
        return
    write_sound(view, directory / "output.wav")
    write_animation(view, directory / "scene.gif")


def _write_space(run: Run) -> None:
    from tautwave.report.scene_sound import write_sound
    from tautwave.report.space_drawing import write_space_animation
    from tautwave.report.space_view import view_space

    view = view_space(run)
    if view is None or not view.efforts or len(view.time) < 2:
        return
    write_sound(view, run.directory / "output.wav")
    write_space_animation(view, run.directory / "scene.gif")
