"""Options that do not go together, or lack what they are about: one sentence each, exit code 2."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

import tautwave_drivers.modbus
from tautwave.session.new import surveying
from tautwave.session.new.surveying import described

Cli = Callable[..., Result]
PROFILE = Path(tautwave_drivers.modbus.__file__).with_name("profiles") / "generic.yaml"
BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("bench --json loop", "--json belongs after the suite: tautwave bench loop --json"),
        ("example --out there", "--out needs the NAME of an example."),
        ("report nowhere", "nowhere: no such directory; give the --out of a run"),
        ("report . nowhere", "nowhere: no such directory; give the --out of a run"),
        ("report . . --against a.csv", "--against compares one run with one file; give no other"),
        ("report . --figures pdf --against a.csv", "--against compares one run with one file"),
        ("report . --map a=b", "--map requires --against FILE."),
        ("report . --time t", "--time requires --against FILE."),
        ("report . --from 0", "--from requires --against FILE."),
        ("report . --to 1", "--to requires --against FILE."),
        ("report . . --figures pdf", "--figures works on one run; give one directory."),
        ("report . --width 84", "--width, --font-size and --font require --figures pdf|svg."),
        ("report . --font-size 9", "--width, --font-size and --font require --figures pdf|svg."),
        ("report . --font Serif", "--width, --font-size and --font require --figures pdf|svg."),
        ("report . --out there", "--out is only for a comparison or --figures."),
        ("report . --against a.csv", "a.csv: no such recording"),
        ("export . --to lerobot --columns time_s", "--columns is for tables; a dataset has fixed"),
        ("export . . --to lerobot", "several runs are combined into one dataset: give its direc"),
        (
            "link serve --keys . --bind 10.0.0.2:7448",
            "an address without a port, such as 10.0.0.2 or ::1; the port is --port (got",
        ),
        ("link serve --keys . --bind [::1]:7448", "the port is --port (got '[::1]:7448')"),
        ("export . --to lerobot --resume", "--resume: name the dataset with --out DIR"),
        ("run {bench} --task pick", "--task: the rig has no `operate` block; write `operate: {}`"),
        ("run {bench} --end-with-input", "--end-with-input requires --commands -"),
        ("new rig.yml --bus '", 'new: --bus "\'": write DRIVER [OPTIONS]'),
        ("new rig.txt --profile {profile}", "new: rig.txt: a rig file name must end in .yaml"),
        (
            "new rig.yaml --profile {profile} --master 1,2 --slave 3,4 --joints a,a",
            "new: --joints: 2 distinct names are needed (got 'a,a')",
        ),
        (
            "new rig.yaml --profile {profile} --master 1,2 --slave 3,4 --joints a",
            "new: --joints: 2 distinct names are needed (got 'a')",
        ),
        (
            "new rig.yaml --profile {profile} --master 1,2 --slave 3",
            "new: 2 devices on the operator's side and 1 on the task side; a pair needs one of",
        ),
    ],
)
def test_options_that_do_not_fit_are_one_sentence(
    tautwave_cli: Cli, words: str, sentence: str
) -> None:
    result = tautwave_cli(*words.format(bench=BENCH, profile=PROFILE).split(" "))
    assert result.exit_code == 2, result.output
    assert sentence in " ".join(result.stderr.split()), result.stderr
    assert "Traceback" not in result.output
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("given", "asked"),
    [
        ((), "in the hand (master)? Specify them with --master, such as --master "),
        (("--master", "1"), "at the task (slave)? Specify them with --slave, such as --slave "),
    ],
)
def test_new_asks_nobody_where_nobody_types(
    tautwave_cli: Cli, monkeypatch: pytest.MonkeyPatch, given: Sequence[str], asked: str
) -> None:
    def survey(places: Any, progress: Any) -> Any:
        return [described("profile", PROFILE, [1, 2])], []

    monkeypatch.setattr(surveying, "survey", survey)
    result = tautwave_cli("new", "rig.yaml", "--bus", "modbus", *given)
    assert result.exit_code == 2
    assert f"new: which devices are {asked}" in result.stderr
    assert "drives" in result.stdout  # what was found
    assert not Path("rig.yaml").exists()
