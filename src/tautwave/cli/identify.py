"""`tautwave identify`: a device by exciting it, an environment or noise from a recording."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import (
    CLOCK,
    PATH,
    Number,
    clock_option,
    echo_json,
    file_options,
    json_option,
    of_kind,
    out_option,
    positive,
    run_flags,
    set_option,
    simulate_option,
    stated_of,
)
from tautwave.errors import ConfigError
from tautwave.kinds import BAG, DATASET, RECORDING, RIG, RUN, TABLE

RIG_SUFFIXES = (".yaml", ".yml")
TEXTS = (".csv", ".tsv", ".txt", ".dat")
RECORDINGS = (".mcap", ".mat", ".npz", ".parquet", ".pq", ".db3", *TEXTS)
MODELS = ("auto", "spring", "contact", "preloaded", "hunt_crossley", "mass")
_RIG_ONLY = (
    "load",
    *("share", "reach", "duration", "clock"),
    *("overrides", "allow_uncertified", "simulate", "attach"),
)
_LEVER = ("position", "effort", "time", "filter_hz", "begin_s", "end_s")
_RECORDING_ONLY = (
    *_LEVER,
    "time_unit",
    "rate",
    "columns",
    "episode",
    "lever",
    "chain",
    "tip",
    "gravity",
    "outside",
    "model",
    "intent",
)
_NOT_NOISE = (
    *("load", "lever", "chain", "tip", "gravity", "share", "reach"),
    *("effort", "outside", "model", "intent", "filter_hz"),
)


@click.command(short_help="Identify a device, an encoder's noise, or an environment.")
@click.argument(
    "source",
    type=PATH,
    metavar="RIG|RECORDING",
    callback=of_kind(RIG, RUN, RECORDING, TABLE, DATASET, BAG),
)
@click.option(
    "--axis", metavar="NAME", help="Axis, such as master.wrist; required if there are several."
)
@click.option(
    "--noise",
    is_flag=True,
    help="Instead, measure the encoder of a lever at rest: step, noise and its colour.",
)
@click.option(
    "--load",
    is_flag=True,
    help="RIG: move an arm's joints, or one axis, slowly to find their weight.",
)
@click.option(
    "--lever",
    is_flag=True,
    help="RECORDING: instead, identify the device itself from its motion and motor effort.",
)
@click.option(
    "--gravity",
    is_flag=True,
    help="RECORDING, --lever: the lever has a weight, which the position turns; it is found, too.",
)
@click.option(
    "--chain",
    metavar="URDF",
    help="RECORDING: instead, find the masses of a whole arm from its motion and motor efforts; a "
    "URDF file, or an arm of a run's own rig: master, slave or, of several, such as slave.left.",
)
@click.option("--tip", metavar="LINK", help="RECORDING, --chain: last link of the arm in the URDF.")
@click.option(
    "--outside",
    metavar="COLUMN",
    help="RECORDING, --lever: column of a sensor for external contact; its scale is estimated too.",
)
@click.option(
    "--intent",
    metavar="COLUMN",
    help="RECORDING: column of the position that the hand intended; the result is its grip.",
)
@out_option("Output directory, new or empty; default: runs/identify-NAME-DATE-TIME.")
@json_option
@click.option(
    "--duration",
    type=float,
    default=12.0,
    callback=positive,
    metavar="S",
    help="RIG: excitation time [s]; default 12.",
)
@clock_option(f"RIG; {CLOCK}")
@click.option(
    "--share",
    type=Number(0.0, 1.0, min_open=True),
    default=0.3,
    metavar="0..1",
    help="RIG: maximum effort as a fraction of the axis' effort_limit; default 0.3.",
)
@click.option(
    "--reach",
    type=float,
    callback=positive,
    metavar="X",
    help="RIG: excitation amplitude around the start position [rad or m]; default: a quarter of "
    "position_range.",
)
@set_option
@simulate_option
@run_flags("--attach", of="RIG: ")
@click.option(
    "--allow-uncertified", is_flag=True, help="RIG: allow motion of a rig that is not certified."
)
@click.option(
    "--position",
    metavar="COLUMN",
    help="RECORDING: column of the position; with --chain A,B,... from base to tip.",
)
@click.option(
    "--effort",
    metavar="COLUMN",
    help="RECORDING: column of the external effort, either sign; with --chain A,B,...",
)
@click.option("--time", metavar="COLUMN", help="RECORDING: column of the time.")
@file_options("RECORDING")
@click.option(
    "--model",
    type=click.Choice(MODELS),
    default="auto",
    show_default=True,
    help="RECORDING: what to fit; mass is for a hand that does not move.",
)
@click.option(
    "--filter-hz",
    type=float,
    callback=positive,
    metavar="HZ",
    help="RECORDING: low-pass on both force and motion; default 40, at most rate / 25.",
)
@click.option(
    "--from", "begin_s", type=Number(), metavar="S", help="[s] RECORDING: use data from this time."
)
@click.option(
    "--to", "end_s", type=Number(), metavar="S", help="[s] RECORDING: use data up to this time."
)
@click.pass_context
def identify(ctx: click.Context, /, source: Path, **options: Any) -> None:
    """Identify the device of an axis of RIG, or the environment in a RECORDING.

    A RIG (.yaml) is run with the coupling off: one axis is excited by a few sines within its
    limits, with a soft centring spring; nothing may hold it. The result is inertia, viscous and
    Coulomb friction with 95 % intervals, as lines for the rig file. A RECORDING is a run's
    directory, a table (CSV, text, Parquet, npz, MAT), an episode of a LeRobot dataset or a ROS 2
    bag: the result is stiffness, damping, surface and force offset
    of the environment (or the hand); with --lever inertia, friction and encoder of the device.

    With --noise the lever must be at rest, preferably clamped; on a RIG no axis gets any effort.
    The result is the encoder's step, and the standard deviation and autocorrelation of its noise.

    \b
    Examples:
        tautwave identify rig.yaml --axis master.wrist
        tautwave identify runs/first --axis slave.wrist
        tautwave identify contact.csv --position x_m --effort force_n
        tautwave identify bench.csv --lever --position x_s --effort tau_s
        tautwave identify rig.yaml --axis master.wrist --noise
        tautwave identify bag --chain arm.urdf --tip tool0
    """
    rig = source.suffix in RIG_SUFFIXES and not source.is_dir()
    if not rig and source.suffix not in RECORDINGS and not source.is_dir():
        raise ConfigError(
            f"{source}: is not a rig (.yaml), a run directory or a recording "
            f"({', '.join(RECORDINGS)}, a LeRobot dataset, a ROS 2 bag)"
        )
    given = {
        p.name: p.opts[0]
        for p in ctx.command.params
        if p.name is not None
        and ctx.get_parameter_source(p.name) is click.core.ParameterSource.COMMANDLINE
    }
    for name in _RECORDING_ONLY if rig else _RIG_ONLY:
        if name in given:
            other, this = ("recording", "rig") if rig else ("rig", "recording")
            raise click.UsageError(f"{given[name]} is for a {other}; {source} is a {this}.")
    for name in _NOT_NOISE if options["noise"] else ():
        if name in given:
            raise click.UsageError(f"{given[name]} cannot be combined with --noise.")
    if options["chain"] is not None:
        for name in ("lever", "model", "intent", "outside", "gravity", "axis"):
            if name in given:
                raise click.UsageError(f"{given[name]} cannot be combined with --chain.")
    elif "tip" in given:
        raise click.UsageError("--tip requires --chain URDF.")
    for name in ("model", "intent") if options["lever"] else ("outside", "gravity"):
        if name in given:
            with_or = "cannot be combined with" if options["lever"] else "requires"
            raise click.UsageError(f"{given[name]} {with_or} --lever.")
    if options["load"] and "share" in given:
        raise click.UsageError("--share cannot be combined with --load.")
    if options["noise"]:
        _noise(source, rig, options)
    elif options["load"]:
        from tautwave.cli.terminal.identify_load import run_load

        run_load(source, options)
    elif options["chain"] is not None:
        from tautwave.cli.terminal.identify_chain import run_chain

        run_chain(source, options)
    elif options["lever"]:
        _lever(source, options)
    elif rig:
        _device(source, options)
    else:
        _recording(source, options)


def _noise(source: Path, rig: bool, options: Mapping[str, Any]) -> None:
    from tautwave.cli.run import fresh_directory
    from tautwave.cli.terminal.moving import moved
    from tautwave.cli.terminal.show import show
    from tautwave.report.figures.identification import noise_figure, write_figure
    from tautwave.report.units import axis_units
    from tautwave.session.identification.recorded import save_result
    from tautwave.session.identification.still import identify_noise, identify_still

    axis = options["axis"]
    if rig:
        from tautwave.config import load_rig

        loaded = load_rig(source, options["overrides"])
        with moved(loaded, options, "standing still") as (directory, given):
            result = identify_still(loaded, axis=axis, **given)
    else:
        names = ("position", "time", "begin_s", "end_s")
        named = {name: options[name] for name in names}
        result = identify_noise(source, axis=axis, stated=stated_of(options), **named)
        directory = fresh_directory(options["out"], f"identify-{source.resolve().stem}")
    save_result(result.as_dict(), directory)
    rotary = result.series.rotary
    unit = "" if rotary is None else axis_units("rotary" if rotary else "linear")[0]
    picture = write_figure(noise_figure(result.fit, result.series.period, unit), directory)
    if options["as_json"]:
        echo_json(result.as_dict() | {"figure": str(picture)})
    else:
        from tautwave.cli.terminal.identified import noise_sections

        show(noise_sections(result, unit, picture))


def _device(source: Path, options: Mapping[str, Any]) -> None:
    from tautwave.cli.terminal.moving import moved
    from tautwave.cli.terminal.show import show
    from tautwave.config import load_rig
    from tautwave.report.units import axis_units

    loaded = load_rig(source, options["overrides"])
    from tautwave.session.identification.identifying import axis_to_identify, identify_device

    axis = axis_to_identify(loaded, options["axis"])
    with moved(loaded, options, axis) as (directory, given):
        result = identify_device(
            loaded, axis=axis, share=options["share"], reach=options["reach"], **given
        )
    from tautwave.report.figures.identification import device_figure, write_figure

    units = axis_units(result.kind)
    picture = write_figure(device_figure(result.fit, axis, units), directory)
    if options["as_json"]:
        echo_json(result.as_dict() | {"figure": str(picture)})
    else:
        from tautwave.cli.terminal.identified import device_sections

        show(device_sections(result, units, picture))


def _lever(source: Path, options: Mapping[str, Any]) -> None:
    from tautwave.cli.run import fresh_directory
    from tautwave.cli.terminal.identified import lever_sections
    from tautwave.cli.terminal.show import show
    from tautwave.report.figures.identification import device_figure, write_figure
    from tautwave.report.units import axis_units
    from tautwave.session.identification.lever import identify_lever
    from tautwave.session.identification.recorded import save_result

    result = identify_lever(
        source,
        stated=stated_of(options),
        **{name: options[name] for name in (*_LEVER, "axis", "outside", "gravity")},
    )
    directory = fresh_directory(options["out"], f"identify-{source.resolve().stem}")
    save_result(result.as_dict(), directory)
    rotary = result.series.rotary
    units = ("", "") if rotary is None else axis_units("rotary" if rotary else "linear")
    name = f"{result.series.position_name} in {source.name}"
    picture = write_figure(device_figure(result.fit, name, units), directory)
    if options["as_json"]:
        echo_json(result.as_dict() | {"figure": str(picture)})
    else:
        show(lever_sections(result, units, picture))


def _recording(source: Path, options: Mapping[str, Any]) -> None:
    from tautwave.cli.run import fresh_directory
    from tautwave.cli.terminal.show import show
    from tautwave.report.figures.identification import contact_figure, write_figure
    from tautwave.report.units import axis_units
    from tautwave.session.identification.recorded import identify_recording, save_result

    result = identify_recording(
        source,
        stated=stated_of(options),
        **{name: options[name] for name in ("axis", *_LEVER, "model", "intent")},
    )
    directory = fresh_directory(options["out"], f"identify-{source.resolve().stem}")
    save_result(result.as_dict(), directory)
    kinds = {True: "rotary", False: "linear"}
    rotary = result.series.rotary
    units = ("", "") if rotary is None else axis_units(kinds[rotary])
    picture = write_figure(
        contact_figure(
            result.chosen,
            result.track_s,
            result.track,
            title=f"{source.name}: {result.series.effort_name}",
            start_s=result.series.start_s,
            units=units,
        ),
        directory,
    )
    if options["as_json"]:
        echo_json(result.as_dict() | {"figure": str(picture)})
    else:
        from tautwave.cli.terminal.identified import contact_sections

        show(contact_sections(result, units, picture))
