"""`tautwave new`: a first rig file, from the devices on the bench."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tautwave.cli.options import PATH
from tautwave.errors import ConfigError

if TYPE_CHECKING:
    from tautwave.session.new.arms import Arm
    from tautwave.session.new.choosing import Chosen
    from tautwave.session.new.surveying import Place
    from tautwave.types import FoundBus


SUFFIXES = (".yaml", ".yml")


@click.command(short_help="Write a first rig file for the connected devices.")
@click.argument("rig", type=PATH)
@click.option(
    "--bus",
    "buses",
    multiple=True,
    metavar="'[NAME=]DRIVER [OPTIONS]'",
    help="Scan this bus, with the options of `tautwave scan DRIVER`; may be repeated. Default: "
    "every USB serial port and CAN interface of this machine.",
)
@click.option("--eds", type=PATH, metavar="FILE", help="CiA 402 drives from their EDS; no scan.")
@click.option("--profile", type=PATH, metavar="FILE", help="Modbus drives from a profile; no scan.")
@click.option(
    "--urdf",
    "urdfs",
    type=PATH,
    multiple=True,
    metavar="FILE",
    help="Arms described by URDF files: one for both sides, or the leader's and the follower's. "
    "Without devices (--bus, --eds, --profile) both are simulated.",
)
@click.option(
    "--tip",
    "tips",
    multiple=True,
    metavar="LINK",
    help="--urdf: last link of the arm, once for both or for each; what is beyond it is held.",
)
@click.option(
    "--base",
    "bases",
    multiple=True,
    metavar="LINK",
    help="--urdf: link that the arm stands on, once or for each; default: the file's root.",
)
@click.option(
    "--from",
    "example",
    metavar="EXAMPLE",
    help="Copy a shipped rig instead; or a rig file (RIG.yaml) or run directory of an older "
    "version, with keys that changed as they are now.",
)
@click.option(
    "--master",
    metavar="DEVICES",
    help="Devices on the operator's side: BUS:IDS, BUS or IDS, such as 1-6.",
)
@click.option(
    "--slave",
    metavar="DEVICES",
    help="Devices on the task side: the same number, in the same order.",
)
@click.option(
    "--joints", metavar="NAMES", help="Names of the pairs, separated by commas; default j1, j2 ..."
)
def new(
    rig: Path,
    buses: Sequence[str],
    eds: Path | None,
    profile: Path | None,
    urdfs: Sequence[Path],
    tips: Sequence[str],
    bases: Sequence[str],
    example: str | None,
    master: str | None,
    slave: str | None,
    joints: str | None,
) -> None:
    """Write the rig file RIG from what the devices report, with TODO for what only you know.

    Asks which devices are on the operator's side and which on the task side, unless given by
    --master and --slave. Enables nothing and writes nothing to a device. Existing files are never
    overwritten.

    \b
    Examples:
        tautwave new arms.yaml
        tautwave new arms.yaml --bus 'dynamixel --port /dev/ttyUSB0 --baud 1000000' \\
            --master 1-6 --slave 11-16
        tautwave new drives.yaml --eds drive.eds --master 1 --slave 2
        tautwave new pair.yaml --urdf panda.urdf --tip panda_link8
        tautwave new bench.yaml --from bench-1dof-loopback
        tautwave new bench-2.yaml --from bench.yaml
    """
    if sum(bool(one) for one in (buses, eds, profile, example)) > 1:
        raise click.UsageError("--bus, --eds, --profile and --from are mutually exclusive.")
    if rig.suffix not in SUFFIXES:
        raise ConfigError(f"new: {rig}: a rig file name must end in .yaml")
    if rig.exists():
        raise ConfigError(
            f"new: {rig} already exists and is not overwritten; choose another file name"
        )
    if urdfs and example:
        raise click.UsageError("--urdf and --from are mutually exclusive.")
    for option, given in (("--tip", tips), ("--base", bases)):
        if given and not urdfs:
            raise click.UsageError(f"{option} requires --urdf.")
        if len(given) > 2:
            raise click.UsageError(f"{option} is given once, or for leader and follower.")
    if len(urdfs) > 2:
        raise click.UsageError("--urdf is given once, or for leader and follower.")
    if example is not None and (Path(example).is_dir() or Path(example).suffix in SUFFIXES):
        _rewritten(rig, Path(example))
        return
    if example is not None:
        _write(rig, _copied(example, rig.stem), "check")
        return
    from tautwave.session.new.choosing import halves, numbers, select
    from tautwave.session.new.draft import Draft
    from tautwave.session.new.fitting import fitted_text
    from tautwave.session.new.surveying import described

    arms = _arms(urdfs, tips, bases)
    if arms and not (buses or eds or profile):
        _simulated(rig, arms, joints)
        return
    if eds or profile:
        ids = [*numbers(master or "1", "--master"), *numbers(slave or "2", "--slave")]
        kind, file = ("eds", eds) if eds else ("profile", profile)
        assert file is not None
        devices = [described(kind, file.resolve(), ids)]
        master, slave = master or "1", slave or "2"
    else:
        devices = _surveyed(buses)
        _show(devices)
    guesses = halves(devices)
    hand = select(
        _asked(master, "--master", "in the hand (master)", guesses[0]), devices, "--master"
    )
    task = select(_asked(slave, "--slave", "at the task (slave)", guesses[1]), devices, "--slave")
    names = _names(joints, hand, task)
    if arms:
        hand, task, names = _within(arms, hand, task, joints)
    text = fitted_text(Draft(rig.stem, hand, task, names, 0.0, arms=arms, path=rig), rig)
    _write(rig, text, *(("check", "accept") if eds or profile else ("calibrate", "accept")))


def _arms(urdfs: Sequence[Path], tips: Sequence[str], bases: Sequence[str]) -> dict[str, Arm]:
    """Return the arm of each side, none without files."""
    if not urdfs:
        return {}
    from tautwave.session.new.arms import read_arm

    arms = {}
    for side, which in (("master", 0), ("slave", -1)):
        tip, base = (given[which] if given else None for given in (tips, bases))
        arms[side] = read_arm(urdfs[which], tip, base)
    return arms


def _simulated(rig: Path, arms: Mapping[str, Arm], joints: str | None) -> None:
    """Write a rig of two arms that are simulated by what their files say."""
    from tautwave.session.new.arms import arm_bus, pair_names
    from tautwave.session.new.choosing import Chosen
    from tautwave.session.new.draft import Draft
    from tautwave.session.new.fitting import fitted_text

    names = pair_names(arms["master"], arms["slave"])
    sides = []
    for bus_name, arm in zip(("hand", "arm"), arms.values(), strict=True):
        bus = arm_bus(bus_name, arm)
        sides.append([Chosen(bus, device) for device in bus.devices])
    if joints is not None:
        names = _names(joints, *sides)
    hand, task = sides
    draft = Draft(rig.stem, hand, task, names, 0.0, arms=arms, path=rig, simulated=True)
    _write(rig, fitted_text(draft, rig), "check")


def _within(
    arms: Mapping[str, Arm], hand: Sequence[Chosen], task: Sequence[Chosen], joints: str | None
) -> tuple[list[Chosen], list[Chosen], list[str]]:
    """Return devices as the joints of arms, from base to tip, within what the files say."""
    from tautwave.session.new.arms import limited, pair_names

    sides = []
    for side, chosen in (("master", hand), ("slave", task)):
        arm = arms[side]
        if len(arm.joints) != len(chosen):
            raise ConfigError(
                f"new: --{side}: {len(chosen)} devices for the {len(arm.joints)} joints of "
                f"{arm.file}, from base to tip: {', '.join(j.limits.name for j in arm.joints)}"
            )
        sides.append(
            [
                one._replace(device=limited(one.device, joint))
                for one, joint in zip(chosen, arm.joints, strict=True)
            ]
        )
    names = pair_names(arms["master"], arms["slave"])
    led, follows = sides
    return led, follows, names if joints is None else _names(joints, led, follows)


def _surveyed(given: Sequence[str]) -> list[FoundBus]:
    from tautwave.cli.terminal.progress import Progress
    from tautwave.session.new.surveying import places, survey

    to_scan = [_place(text) for text in given] if given else places()
    if not to_scan:
        raise ConfigError(
            "new: this machine has no USB serial port and no CAN interface; plug in the adapter, "
            "or name a bus: --bus 'modbus --endpoint tcp://192.168.1.20:502'"
        )
    with Progress("new") as progress:
        devices, without = survey(to_scan, progress)
    for sentence in without:
        click.echo(sentence, err=True)
    if not devices:
        raise ConfigError(
            "new: found no device that a rig can drive; are the devices powered?"
            " `tautwave scan DRIVER --help` lists the options of a scan"
        )
    return devices


def _place(text: str) -> Place:
    """Read `arm=dynamixel --port /dev/ttyUSB0`."""
    from tautwave.cli.terminal.model_options import parse_model
    from tautwave.registry import load_driver, require_modules
    from tautwave.session.new.surveying import Place, surveyor

    try:
        first, *arguments = shlex.split(text)
    except ValueError as err:
        raise ConfigError(f"new: --bus {text!r}: write DRIVER [OPTIONS]") from err
    name, equals, driver = first.partition("=")
    name, driver = (name, driver) if equals else ("", name)
    plugin = load_driver(driver)
    surveyor(driver, plugin)
    require_modules(driver)
    assert plugin.scan_options is not None
    return Place(driver, parse_model(plugin.scan_options, arguments, f"new: --bus {driver}"), name)


def _show(found: Sequence[FoundBus]) -> None:
    from tautwave.cli.terminal.show import show
    from tautwave.tables import Table

    rows = [(bus.name, str(device.id), device.name) for bus in found for device in bus.devices]
    show([Table("Devices found", ("bus", "id", "device"), rows)])


def _asked(given: str | None, option: str, question: str, guess: str) -> str:
    if given is not None:
        return given
    if not sys.stdin.isatty():
        hint = f", such as {option} {guess}" if guess else ""
        raise ConfigError(f"new: which devices are {question}? Specify them with {option}{hint}")
    answer: str = click.prompt(f"Devices {question}", default=guess or None)
    return answer


def _names(joints: str | None, hand: Sequence[Chosen], task: Sequence[Chosen]) -> list[str]:
    if len(hand) != len(task):
        raise ConfigError(
            f"new: {len(hand)} devices on the operator's side and {len(task)} on the "
            "task side; a pair needs one of each"
        )
    both = [one for one in hand if one in task]
    if both:
        raise ConfigError(f"new: {both[0].bus.name}:{both[0].device.id} is on both sides")
    if joints is None:
        return [f"j{number + 1}" for number in range(len(hand))]
    names = [name.strip() for name in joints.split(",")]
    if len(names) != len(hand) or len(set(names)) != len(names):
        raise ConfigError(f"new: --joints: {len(hand)} distinct names are needed (got {joints!r})")
    return names


def _copied(example: str, name: str) -> str:
    """Return a shipped rig under another name."""
    import re

    from tautwave.config.shipped import find_example
    from tautwave.config.text.resolved import flow_yaml

    text = find_example(example).path.read_text(encoding="utf-8")
    return re.sub(r"^name: .*$", lambda _: f"name: {flow_yaml(name)}", text, count=1, flags=re.M)


def _rewritten(rig: Path, before: Path) -> None:
    """Write an older rig file, or that of a run, with its keys as they are now; then read it."""
    from tautwave.config import load_rig
    from tautwave.config.rewriting import rewrite_older
    from tautwave.config.text.document import read_text

    file = before / "rig.yaml" if before.is_dir() else before
    rewritten = rewrite_older(read_text(file), str(file))
    for change in rewritten.changes:
        click.echo(f"{file}: {change}")
    if not rewritten.changes:
        click.echo(f"{file}: no key has changed")
    _write(rig, rewritten.text, "check")
    load_rig(rig, choose=False)  # what is left to do by hand is said with its line


def _write(rig: Path, text: str, *commands: str) -> None:
    from tautwave.files import make_directory, write_text

    make_directory(rig.parent)
    write_text(rig, text)
    left = text.count("TODO") - text.count("marked TODO")
    marks = f", {left} marked TODO" if left else ""
    click.echo(f"{rig}: {len(text.splitlines())} lines{marks}")
    name = shlex.quote(str(rig))
    click.echo(f"next: {', then '.join(f'tautwave {command} {name}' for command in commands)}")
