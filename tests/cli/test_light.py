"""The command line imports a backend when a command needs it, and not before."""

from __future__ import annotations

import subprocess
import sys

import pytest

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
