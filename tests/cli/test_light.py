"""The command line imports a backend when a command needs it, and not before."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

CONFIGS = Path(__file__).parents[2] / "configs"

HEAVY = {"numpy", "pydantic", "yaml", "rich", "mcap", "zstandard", "matplotlib", "scipy", "numba"}


def imported_by(*words: str) -> set[str]:
    code = (
        "import sys, atexit\n"
        "atexit.register(lambda: print('imported', *sys.modules, file=sys.stderr))\n"
        "from tautwave.cli import main\n"
        f"main({list(words)!r}, prog_name='tautwave')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    line = next(line for line in done.stderr.splitlines() if line.startswith("imported "))
    return set(line.split())


@pytest.mark.parametrize(
    "words", [("--help",), ("--version",), ("run", "--help"), ("rum",), ("check", "--jsno")]
)
def test_help_and_mistakes_import_nothing_heavy(words: tuple[str, ...]) -> None:
    modules = imported_by(*words)
    assert not HEAVY & {name.partition(".")[0] for name in modules}


NEVER = {
    *("numba", "scipy", "matplotlib", "rich", "mcap", "zstandard", "numpy.ma", "numpy.random"),
    *("asyncio", "http", "subprocess", "multiprocessing"),
    *("tautwave.simulation", "tautwave.sites", "tautwave.session.running"),
}
"""What no check of a rig needs: engines, viewers, files of runs, processes."""

DEVICES = {
    *("tautwave.truth", "tautwave.rig.truth", "tautwave.rig.assembly", "tautwave.rig.carrying"),
    *("tautwave.runtime.loop", "tautwave.runtime.sensing", "tautwave.runtime.wire"),
    *("tautwave.link.network", "tautwave_sim.axis", "tautwave_scenes", "xml", "difflib"),
    *("tautwave.config.inputs.urdf", "tautwave.analysis.wave_port.admittance_loop"),
}
"""What only devices that move, arms, networks, scenes, or mistakes of a rig need."""


@pytest.mark.parametrize(
    ("rig", "unneeded"),
    [
        ("bench-position-coupling", DEVICES | {"tautwave.couplings.wave", "tautwave_drivers"}),
        ("bench-1dof-loopback", DEVICES | {"tautwave.couplings.position", "tautwave_drivers"}),
        pytest.param("bench-foam-loopback", DEVICES, marks=pytest.mark.slow),
        pytest.param("network-loopback", DEVICES, marks=pytest.mark.slow),
        pytest.param("xl330-pair", DEVICES | {"tautwave_sim"}, marks=pytest.mark.slow),
        pytest.param("bench-canopen-virtual", {"tautwave_scenes", "xml"}, marks=pytest.mark.slow),
        pytest.param("scene-net", {"tautwave_drivers", "xml", "difflib"}, marks=pytest.mark.slow),
        pytest.param("scene-granular", {"tautwave_drivers"}, marks=pytest.mark.slow),
        pytest.param("arms/six-seven", {"tautwave_scenes"}, marks=pytest.mark.slow),
    ],
)
def test_a_check_imports_what_its_rig_needs(rig: str, unneeded: set[str]) -> None:
    modules = imported_by("check", str(CONFIGS / f"{rig}.yaml"))
    assert "tautwave.certificate" in modules
    assert not (NEVER | unneeded) & modules


def test_a_process_that_ends_does_not_look_for_cycles_of_objects() -> None:
    """That search was a sixth of a check: the process takes all memory with it anyway."""
    code = (
        "import atexit, gc, sys\n"
        "atexit.register(lambda: print(gc.get_freeze_count(), file=sys.stderr))\n"
        "sys.argv = ['tautwave', '--version']\n"
        "from tautwave.cli import main\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stderr) > 10_000


def test_version_imports_no_command() -> None:
    assert "tautwave.cli.run" not in imported_by("--version")


def test_completion_knows_commands_and_options() -> None:
    from click.shell_completion import ShellComplete

    from tautwave.cli import main

    complete = ShellComplete(main, {}, "tautwave", "_TAUTWAVE_COMPLETE")
    assert [item.value for item in complete.get_completions([], "ch")] == ["check"]
    assert "--allow-uncertified" in {i.value for i in complete.get_completions(["run"], "--a")}


def test_ctrl_c_while_modules_are_read_is_one_sentence() -> None:
    """Python takes a tenth of a second before any command could catch it."""
    code = (
        "import sys\n"
        "class Ended:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'click': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Ended())\n"
        "from tautwave.cli import main"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert done.stderr == "tautwave: ended by Ctrl-C before anything began\n"
