"""What each command asks of its backend, prints, and exits with."""

from __future__ import annotations

import errno
import json
import re
import sys
from collections.abc import Callable, Iterator
from datetime import datetime, tzinfo
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import Result

from tautwave import errors
from tautwave.cli import main
from tautwave.cli import run as run_command
from tautwave.cli.run import fresh_directory
from tests.cli.conftest import Backend

Cli = Callable[..., Result]


def all_commands(group: click.Command, words: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    found = [words]
    if isinstance(group, click.Group):
        context = click.Context(group)
        for name in group.list_commands(context):
            command = group.get_command(context, name)
            assert command is not None
            found += all_commands(command, (*words, name))
    return found


@pytest.mark.parametrize("words", all_commands(main), ids=" ".join)
def test_every_help_has_an_example(tautwave_cli: Cli, words: tuple[str, ...]) -> None:
    result = tautwave_cli(*words, "--help")
    assert result.exit_code == 0
    assert re.search(rf"^ +tautwave {' '.join(words)}", result.output, re.MULTILINE)
    assert "None" not in result.output  # of a range without bounds


def all_options() -> Iterator[tuple[click.Context, click.Parameter]]:
    for words in all_commands(main):
        command: click.Command = main
        for word in words:
            assert isinstance(command, click.Group)
            found = command.get_command(click.Context(command), word)
            assert found is not None
            command = found
        for option in command.params:
            yield click.Context(command), option


def test_a_number_on_the_command_line_is_finite() -> None:
    """Whatever the option: click takes `nan` for a float, and as in any range."""
    for context, option in all_options():
        if not isinstance(option.type, click.FloatRange | click.types.FloatParamType):
            continue
        with pytest.raises(click.BadParameter, match="finite number"):
            option.process_value(context, "nan")


def test_the_help_says_what_holds_where_an_option_is_left_out() -> None:
    said = 0
    for context, option in all_options():
        default = option.get_default(context)
        if not isinstance(option, click.Option) or option.is_flag or not default:
            continue
        if not isinstance(default, str | int | float | tuple):
            continue  # click's own mark of none
        shown = ", ".join(default) if isinstance(default, tuple) else str(default)
        words = [f"default: {shown}"]
        words += [] if isinstance(default, str | tuple) else [f"default {default:g}"]
        _, text = option.get_help_record(context) or ("", "")
        assert any(each in text for each in words), f"{context.command.name} {option.name}: {text}"
        said += 1
    assert said > 30


def test_version(tautwave_cli: Cli) -> None:
    assert re.fullmatch(r"tautwave \d+\.\d+\.\d+\n", tautwave_cli("--version").output)


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["chek", "rig.yaml"], "Did you mean 'check'?"),
        (["rum"], "Did you mean 'run'?"),
        (["zzz"], "There are example, new, check, run, view, scan, sim"),
        (["run", "rig.yaml", "--duratoin", "1"], "--duration"),
        (["run", "rig.yaml", "--clock", "fast"], "'real', 'fake'"),
        (["run", "rig.yaml", "--duration", "nan"], "finite number above 0"),
        (["run", "rig.yaml", "--duration", "-1"], "finite number above 0"),
        (["run"], "Missing argument 'RIG'"),
        (["report", "a", "--out", "b"], "no such directory"),
    ],
)
def test_usage_errors_exit_2_with_a_hint(tautwave_cli: Cli, words: list[str], hint: str) -> None:
    result = tautwave_cli(*words)
    assert result.exit_code == 2
    assert hint in result.stderr
    assert result.stdout == ""


def test_run_passes_everything_on(tautwave_cli: Cli, backend: Backend, tmp_path: Path) -> None:
    words = ["run", "rig.yaml", "--clock", "fake", "--duration", "2", "--out", "there"]
    result = tautwave_cli(*words, "--set", "rate_hz=500", "--set", "name=a b", "--configure")
    assert result.exit_code == 0, result.output
    assert backend.loaded == (Path("rig.yaml"), ("rate_hz=500", "name=a b"))
    asked = backend.run_arguments
    del asked["progress"], asked["warn"]
    assert asked == {
        "draw_later": False,
        "allow_tuning": False,
        "clock": "fake",
        "duration_s": 2.0,
        "out": Path("there"),
        "command": "tautwave run rig.yaml --clock fake --duration 2 --out there"
        " --set rate_hz=500 --set 'name=a b' --configure",
        "allow_uncertified": False,
        "allow_unwatched": False,
        "configure": True,
        "attach": False,
        "simulate": (),
        "scripts": (),
        "live": [],
    }


def test_run_says_first_which_way_each_bus_takes(tautwave_cli: Cli, backend: Backend) -> None:
    backend.ways = ["bus hand  hardware at /dev/ttyUSB0", "bus arm   simulated here, in memory"]
    result = tautwave_cli("run", "rig.yaml", "--simulate", "arm", "--simulate", "leg", "--attach")
    assert result.stdout.splitlines()[:2] == backend.ways
    assert backend.ways_asked == {"clock": "real", "simulate": ("arm", "leg"), "attach": True}
    assert backend.run_arguments["simulate"] == ("arm", "leg")
    tautwave_cli("run", "rig.yaml", "--simulate", "--duration", "2")
    assert backend.run_arguments["simulate"] is True


def test_run_shows_the_summary(tautwave_cli: Cli, backend: Backend) -> None:
    backend.summary["axes"] = {
        "slave.wrist": {"lost": 4, "late": 1, "faults": [{"text": "over-heated"}]}
    }
    output = tautwave_cli("run", "rig.yaml", "--out", "there", "--verbose").output
    assert "bench / 1dof: finished, 2000 cycles at 1 kHz, 3 missed, in 80 ms" in output
    for line in (
        r"wrist +12\.3 mrad +40 mrad +1 mN m +2 mN m",
        r"residual +2\.5e-14 J +1e-14 of gross flow",
        r"certificate +not yet evaluated",
        r"compute +41\.5 us +60 us +80 us +95 us",
        r"slave\.wrist +4 +1 +over-heated",
        r"wall_master +the rig has none",
        r"there/summary\.json",
    ):
        assert re.search(line, output), f"{line} is not in\n{output}"
    assert output.isascii()
    short = tautwave_cli("run", "rig.yaml", "--out", "again").output
    for line in (
        r"wrist +12\.3 mrad +40 mrad +1 mN m +2 mN m",
        r"slave\.wrist +4 +1 +over-heated",
        r"certificate +: not yet evaluated",
        r"energy books +closed",
        r"again/summary\.json",
    ):
        assert re.search(line, short), f"{line} is not in\n{short}"
    assert not re.search("residual|compute|wall_master", short)
    assert len(short.splitlines()) <= 24


def test_what_runs_unwatched_is_said_before_and_listed_after(
    tautwave_cli: Cli, backend: Backend
) -> None:
    result = tautwave_cli("run", "rig.yaml", "--allow-unwatched")
    assert backend.run_arguments["allow_unwatched"] is True
    assert (result.exit_code, result.stderr) == (0, ""), "permission alone is no danger"
    assert "no watchdog" not in result.stdout
    backend.warnings = ["UNWATCHED: slave.wrist keeps its last command"]
    backend.summary["buses"] = {"can": {"unwatched": {"slave.wrist": "keeps its last command"}}}
    result = tautwave_cli("run", "rig.yaml", "--allow-unwatched")
    assert result.stderr.splitlines() == backend.warnings
    assert re.search(r"no watchdog +slave.wrist: keeps its last command", result.stdout)
    whole = tautwave_cli("run", "rig.yaml", "--allow-unwatched", "--verbose").stdout
    assert re.search(r"No watchdog\n +slave.wrist +keeps its last command", whole)


def test_a_run_that_was_stopped_says_so_on_stderr(tautwave_cli: Cli, backend: Backend) -> None:
    sentence = "slave.wrist left its position range at 1.2 s."
    backend.summary["outcome"] = {"kind": "safety_stop", "sentence": sentence}
    backend.summary["incomplete"] = "the recording is incomplete: disk full"
    backend.summary["report_error"] = "the report could not be written: no font"
    backend.exit_code = 6
    result = tautwave_cli("run", "rig.yaml")
    assert result.stdout.startswith("bench / 1dof: safety stop, 2000 cycles")
    assert "the report could not be written: no font." in result.stdout
    assert "has all files" not in result.stdout
    assert "has what could be written; --verbose" in result.stdout
    assert "The recording is incomplete: disk full." in result.stdout
    reported = (
        "slave.wrist left its position range at 1.2 s; the recording is incomplete: disk full"
    )
    assert result.stderr == f"{reported}\n"


def test_a_run_of_which_little_is_known_is_shown_too(tautwave_cli: Cli, backend: Backend) -> None:
    backend.summary = {"outcome": None, "pairs": None, "energy_j": {"gross_flow": None}}
    result = tautwave_cli("run", "rig.yaml")
    assert result.exit_code == 0
    assert result.stdout.startswith("bench / 1dof: finished\n")


def test_a_default_directory_is_new_each_time(
    tautwave_cli: Cli, backend: Backend, tmp_path: Path
) -> None:
    for _ in range(3):
        assert tautwave_cli("run", "rig.yaml").exit_code == 0
    made = sorted(path.name for path in (tmp_path / "runs").iterdir())
    assert len(made) == 3
    assert all(re.fullmatch(r"bench-1dof-\d{8}-\d{6}(-\d)?", name) for name in made)


def test_run_overwrites_nothing(tautwave_cli: Cli, backend: Backend, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there/precious.txt").write_text("data")
    result = tautwave_cli("run", "rig.yaml", "--out", "there")
    assert result.exit_code == 2
    assert result.stderr.startswith("there: not empty")
    assert backend.run_arguments == {}


def test_a_directory_that_cannot_be_made_is_one_sentence(
    tautwave_cli: Cli, backend: Backend, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    result = tautwave_cli("run", "rig.yaml", "--out", "file/sub")
    assert result.exit_code == 2
    assert result.stderr == "file/sub: cannot be a directory: Not a directory\n"


@pytest.mark.parametrize(
    "error",
    [
        errors.ConfigError(["rig.yaml:5: one", "rig.yaml:7: two"]),
        errors.NotCertifiedError("not certified"),
        errors.BusBudgetError("too fast"),
        errors.BusTimeout("no answer"),
        errors.DeviceFault("over-heated"),
        errors.LinkError("lost"),
        errors.SafetyStop("too far"),
        errors.RecordingError("disk full"),
    ],
    ids=lambda error: type(error).__name__,
)
@pytest.mark.parametrize("command", ["run", "check"])
def test_an_error_is_its_sentence_and_its_exit_code(
    tautwave_cli: Cli, backend: Backend, tmp_path: Path, command: str, error: errors.TautwaveError
) -> None:
    backend.error = error
    result = tautwave_cli(command, "rig.yaml")
    assert result.exit_code == error.exit_code
    assert result.stderr == f"{error}\n"
    assert result.stdout == ""
    assert not list(tmp_path.glob("runs/*")), "a run that never began leaves nothing"


@pytest.mark.parametrize("code", [0, 3, 5, 6])
def test_the_exit_code_of_the_run_is_kept(tautwave_cli: Cli, backend: Backend, code: int) -> None:
    backend.exit_code = code
    assert tautwave_cli("run", "rig.yaml").exit_code == code
    assert tautwave_cli("check", "rig.yaml").exit_code == code


def test_an_unexpected_error_is_a_sentence_and_a_file(
    tautwave_cli: Cli, backend: Backend, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    backend.error = ZeroDivisionError("division by zero")
    result = tautwave_cli("check", "rig.yaml")
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert "ZeroDivisionError: division by zero" in result.stderr
    saved = Path(result.stderr.split()[-1]).read_text()
    assert saved.startswith("tautwave check rig.yaml\n")
    assert "Traceback (most recent call last)" in saved


@pytest.mark.parametrize("command", ["check", "run", "report", "export", "view", "ros", "doctor"])
def test_a_path_that_cannot_be_looked_at_is_a_sentence(tautwave_cli: Cli, command: str) -> None:
    name = "x" * 300
    result = tautwave_cli(command, name)
    assert result.exit_code == 2
    assert result.stderr == f"{name}: cannot be reached: File name too long\n"


def test_a_folder_without_permission_is_a_sentence(tautwave_cli: Cli, backend: Backend) -> None:
    backend.error = PermissionError(errno.EACCES, "Permission denied", "locked/rig.yaml")
    result = tautwave_cli("check", "locked/rig.yaml")
    assert result.exit_code == 2
    assert result.stderr == "locked/rig.yaml: cannot be reached: Permission denied\n"


@pytest.mark.parametrize("letter", ["x", "\N{GREEK SMALL LETTER BETA}"])
def test_a_long_name_gives_a_directory_that_a_disk_takes(
    tautwave_cli: Cli, backend: Backend, tmp_path: Path, letter: str
) -> None:
    made = fresh_directory(None, letter * 300)
    assert made.is_dir()
    assert made.name.startswith(letter * 70)


def test_runs_of_one_second_get_directories_of_their_own(
    monkeypatch: pytest.MonkeyPatch, tautwave_cli: Cli, backend: Backend
) -> None:
    class Stopped(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Stopped:
            return cls(2026, 5, 4, 3, 2, 1, tzinfo=tz)

    monkeypatch.setattr(run_command, "datetime", Stopped)
    made = [fresh_directory(None, "bench / 1dof").name for _ in range(3)]
    assert made == [f"bench-1dof-20260504-030201{more}" for more in ("", "-2", "-3")]


def test_check_prints_facts_plan_time_and_certificate(tautwave_cli: Cli, backend: Backend) -> None:
    result = tautwave_cli("check", "rig.yaml", "--verbose")
    assert result.exit_code == 0
    for line in (
        r"delay line +in +delay_s is 0\.05",
        r"wall_master +left out +the rig has none",
        r"rate +1000 Hz",
        r"hand +not yet evaluated",
        r"arm +400 us +2\.5 kHz +4 frames",
        r"passive +not yet evaluated",
    ):
        assert re.search(line, result.stdout), f"{line} is not in\n{result.stdout}"
    assert not any(line.endswith("  passed") for line in result.stdout.splitlines())
    assert result.stdout.endswith("bench / 1dof: may run.\n")
    short = tautwave_cli("check", "rig.yaml").stdout
    assert "4 frames" not in short
    assert "delay line" not in short
    assert re.search(r"wrist +50 ms", short)


def test_check_json_and_out(tautwave_cli: Cli, backend: Backend, tmp_path: Path) -> None:
    result = tautwave_cli("check", "rig.yaml", "--json", "--out", "a/b")
    printed = json.loads(result.stdout)
    assert printed == {"name": "bench", "plan": [["delay line", "in", ""]]}
    assert json.loads((tmp_path / "a/b/check.json").read_text()) == printed
    whole = tautwave_cli("check", "rig.yaml", "--verbose").stdout
    assert (tmp_path / "a/b/check.txt").read_text() == whole


def test_check_schema_needs_no_rig(tautwave_cli: Cli, backend: Backend) -> None:
    result = tautwave_cli("check", "--schema")
    assert result.exit_code == 0
    assert json.loads(result.stdout) == {"title": "Rig"}


def test_report_rebuilds_or_compares(
    tautwave_cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import tautwave.report

    calls: list[tuple[Any, ...]] = []

    def write_report(directory: Path, *, replace: bool) -> Path:
        assert not replace
        calls.append((directory,))
        return directory / "report.html"

    def compare_reports(first: Path, second: Path, out: Path) -> Path:
        calls.append((first, second, out))
        return out / "compare.html"

    monkeypatch.setattr(tautwave.report, "write_report", write_report, raising=False)
    monkeypatch.setattr(tautwave.report, "compare_reports", compare_reports, raising=False)
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    assert tautwave_cli("report", "a").stdout == "a/report.html\n"
    assert tautwave_cli("report", "a", "b").exit_code == 0
    assert tautwave_cli("report", "a", "b", "--out", "c").stdout == "c/compare.html\n"
    assert tautwave_cli("report", "a", "--out", "c").exit_code == 2
    assert calls == [
        (Path("a"),),
        (Path("a"), Path("b"), tmp_path / "compare-a-b"),
        (Path("a"), Path("b"), Path("c")),
    ]


def test_drivers_lists_the_loopback(tautwave_cli: Cli) -> None:
    listed = json.loads(tautwave_cli("drivers", "--json").stdout)
    assert "loopback" in [entry["name"] for entry in listed]
    table = tautwave_cli("drivers").stdout
    assert re.search(r"loopback +tautwave \d", table)
    [scene] = [entry for entry in listed if entry["kind"] == "control"]
    assert scene["name"] == "scene"
    assert scene["summary"]
    assert not scene["missing"]
    assert re.search(r"Controls(.|\n)*scene +tautwave \d", table)


def test_a_control_whose_package_is_gone_is_listed_with_what_to_install(
    tautwave_cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "tautwave_scenes", None)
    listed = json.loads(tautwave_cli("drivers", "--json").stdout)
    [scene] = [entry for entry in listed if entry["kind"] == "control"]
    assert "pip install" in scene["missing"][0]
