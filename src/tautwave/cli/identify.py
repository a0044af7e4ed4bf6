"""`tautwave identify`: a device by exciting it, an environment or noise from a recording."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import (
    PATH,
    echo_json,
    json_option,
    out_option,
    positive,
    set_option,
    simulate_option,
)
from tautwave.errors import ConfigError

RIG_SUFFIXES = (".yaml", ".yml")
RECORDINGS = (".mcap", ".csv")
MODELS = ("auto", "spring", "contact", "preloaded", "hunt_crossley", "mass")
_RIG_ONLY = (
    *("share", "reach", "duration", "clock"),
    *("overrides", "allow_uncertified", "simulate", "attach"),
)
_RECORDING_ONLY = ("position", "effort", "time", "model", "filter_hz", "begin_s", "end_s")
_NOT_NOISE = ("share", "reach", "effort", "model", "filter_hz")


@click.command(short_help="Identify a device, an encoder's noise, or an environment.")
@click.argument("source", type=PATH, metavar="RIG|RECORDING")
@click.option("--axis", metavar="NAME", help="Such as master.wrist; required if there are several.")
@click.option(
    "--noise",
    is_flag=True,
    help="Measure the encoder of a lever that stands still instead: step, noise, its colour.",
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
@click.option(
    "--clock",
    type=click.Choice(["real", "fake"]),
    default="real",
    show_default=True,
    help="RIG: as for run.",
)
@click.option(
    "--share",
    type=click.FloatRange(0.0, 1.0, min_open=True),
    default=0.3,
    metavar="0..1",
    help="RIG: greatest effort as a share of the axis' effort_limit; default 0.3.",
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
@click.option("--attach", is_flag=True, help="RIG: as for run.")
@click.option(
    "--allow-uncertified", is_flag=True, help="RIG: move motors of a rig that is not certified."
)
@click.option("--position", metavar="COLUMN", help="RECORDING: column of the position.")
@click.option(
    "--effort", metavar="COLUMN", help="RECORDING: column of the external effort, either sign."
)
@click.option("--time", metavar="COLUMN", help="RECORDING: column of the time [s].")
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
    help="RECORDING: low-pass on force and motion alike; default 40, at most rate / 25.",
)
@click.option("--from", "begin_s", type=float, metavar="S", help="RECORDING: use from here.")
@click.option("--to", "end_s", type=float, metavar="S", help="RECORDING: use up to here.")
@click.pass_context
def identify(ctx: click.Context, /, source: Path, **options: Any) -> None:
    """Identify the device of an axis of RIG, or the environment in a RECORDING.

    A RIG (.yaml) is run: the coupling is off, one axis is excited by a few sines within its limits
    and a soft centring spring; nothing may hold it. The result is inertia, viscous and Coulomb
    friction with 95 % intervals, as lines for the rig file. A RECORDING is a run's directory, its
    .mcap, or a .csv: the result is stiffness, damping, surface and force offset of the environment
    (or the hand).

    With --noise the lever stands still, clamped best; of a RIG no axis gets any effort. The result
    is the encoder's step, and standard deviation and autocorrelation of its noise.

    \b
    Examples:
        tautwave identify rig.yaml --axis master.wrist
        tautwave identify runs/first --axis slave.wrist
        tautwave identify contact.csv --position x_m --effort force_n
        tautwave identify rig.yaml --axis master.wrist --noise
    """
    rig = source.suffix in RIG_SUFFIXES and not source.is_dir()
    if not rig and source.suffix not in RECORDINGS and not source.is_dir():
        raise ConfigError(
            f"{source}: is neither a rig (.yaml), a run's directory nor a recording (.mcap, .csv)"
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
            raise click.UsageError(f"{given[name]} has no meaning with --noise.")
    if options["noise"]:
        _noise(source, rig, options)
    elif rig:
        _device(source, options)
    else:
        _recording(source, options)


def _noise(source: Path, rig: bool, options: Mapping[str, Any]) -> None:
    from tautwave.cli.run import fresh_directory
    from tautwave.cli.terminal.progress import Progress
    from tautwave.cli.terminal.show import show
    from tautwave.report.figures.identification import noise_figure, write_figure
    from tautwave.report.units import axis_units
    from tautwave.session.identification.recorded import save_result
    from tautwave.session.identification.still import identify_noise, identify_still

    axis = options["axis"]
    if rig:
        from tautwave.config import load_rig
        from tautwave.session import describe_ways

        loaded = load_rig(source, options["overrides"])
        ways = {name: options[name] for name in ("clock", "simulate", "attach")}
        for sentence in describe_ways(loaded, **ways):
            click.echo(sentence, err=options["as_json"])
        directory = fresh_directory(options["out"], f"identify-{loaded.name}")
        try:
            with Progress("standing still") as progress:
                result = identify_still(
                    loaded,
                    axis=axis,
                    out=directory,
                    duration_s=options["duration"],
                    allow_uncertified=options["allow_uncertified"],
                    progress=progress,
                    **ways,
                )
        finally:
            with suppress(OSError):
                directory.rmdir()
    else:
        names = ("position", "time", "begin_s", "end_s")
        result = identify_noise(source, axis=axis, **{name: options[name] for name in names})
        directory = fresh_directory(options["out"], f"identify-{source.resolve().stem}")
    save_result(result.as_dict(), directory)
    rotary = result.series.rotary
    unit = "" if rotary is None else axis_units("rotary" if rotary else "linear")[0]
    picture = write_figure(noise_figure(result.fit, result.series.period, unit), directory)
    if options["as_json"]:
        echo_json(result.as_dict() | {"figure": str(picture)})
    else:
        show(noise_sections(result, unit, picture))


def _device(source: Path, options: Mapping[str, Any]) -> None:
    from tautwave.cli.run import fresh_directory
    from tautwave.cli.terminal.progress import Progress
    from tautwave.cli.terminal.show import show
    from tautwave.config import load_rig
    from tautwave.report.units import axis_units

    loaded = load_rig(source, options["overrides"])
    from tautwave.session import describe_ways
    from tautwave.session.identification.identifying import axis_to_identify, identify_device

    axis = axis_to_identify(loaded, options["axis"])
    ways = {name: options[name] for name in ("clock", "simulate", "attach")}
    for sentence in describe_ways(loaded, **ways):
        click.echo(sentence, err=options["as_json"])
    directory = fresh_directory(options["out"], f"identify-{loaded.name}")
    try:
        with Progress(axis) as progress:
            result = identify_device(
                loaded,
                axis=axis,
                out=directory,
                clock=options["clock"],
                duration_s=options["duration"],
                share=options["share"],
                reach=options["reach"],
                allow_uncertified=options["allow_uncertified"],
                simulate=options["simulate"],
                attach=options["attach"],
                progress=progress,
            )
    finally:
        with suppress(OSError):
            directory.rmdir()  # removes it only if empty: a refused rig leaves nothing
    from tautwave.report.figures.identification import device_figure, write_figure

    units = axis_units(result.kind)
    picture = write_figure(device_figure(result.fit, axis, units), directory)
    if options["as_json"]:
        echo_json(result.as_dict() | {"figure": str(picture)})
    else:
        show(device_sections(result, units, picture))


def _recording(source: Path, options: Mapping[str, Any]) -> None:
    from tautwave.cli.run import fresh_directory
    from tautwave.cli.terminal.show import show
    from tautwave.report.figures.identification import contact_figure, write_figure
    from tautwave.report.units import axis_units
    from tautwave.session.identification.recorded import identify_recording, save_result

    result = identify_recording(
        source,
        **{name: options[name] for name in ("axis", *_RECORDING_ONLY)},
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
        show(contact_sections(result, units, picture))


def _line(name: str, estimate: Any, unit: str) -> tuple[str, str, str, str]:
    return name, f"{estimate.value:.5g}", f"{estimate.lower:.5g} to {estimate.upper:.5g}", unit


def _head(what: str) -> tuple[str, str, str, str]:
    return what, ">value", ">95 % interval", ""


def device_sections(result: Any, units: tuple[str, str], picture: Path) -> list[Any]:
    """Parameters, lines for the rig file, warnings and files of an identified device."""
    from tautwave.cli.terminal.show import Section

    place, effort = units
    fit = result.fit
    mass = "kg m^2" if place == "rad" else "kg"
    rows = [
        _line("inertia", fit.inertia, mass),
        _line("viscous damping", fit.damping, f"{effort} s/{place}"),
        _line("Coulomb friction", fit.coulomb, effort),
        _line("constant effort from outside", fit.bias, effort),
        (
            "residual, rms",
            f"{fit.residual_rms:.3g}",
            f"{1 - fit.explained:.2%} of variance",
            effort,
        ),
    ]
    how = f"shaken for {result.duration_s:g} s, up to {fit.peak_velocity:.3g} {place}/s"
    key = result.axis.replace(".", ".axes.")
    return [
        Section(f"{result.axis}: {how}", (), ()),
        Section("Device", _head("parameter"), rows),
        Section(f"For {key} in the rig file", ("",), [(t,) for t in _lines_of(result)]),
        Section("Notes", ("",), [(note,) for note in result.notes]),
        Section(
            "Files", ("",), [(str(result.directory / "identification.json"),), (str(picture),)]
        ),
    ]


def _lines_of(result: Any) -> list[str]:
    return str(result.as_dict()["snippet"]).splitlines()


def noise_sections(result: Any, unit: str, picture: Path) -> list[Any]:
    """Step, deviation and colour of an encoder's noise, lines for the rig file, files."""
    from tautwave.cli.terminal.show import Section

    fit, series = result.fit, result.series
    step = "unknown" if fit.quantum is None else f"{fit.quantum:.5g}"
    rows = [
        ("encoder step", step, f"{fit.levels} values", unit),
        _line("noise, standard deviation", fit.deviation, unit),
        ("drift, removed", f"{fit.drift:.3g}", "", unit),
    ]
    if fit.autocorrelation is not None:
        rows.insert(2, ("autocorrelation, lag 1", f"{fit.autocorrelation[0]:.3f}",
                        f"+- {fit.lag_error:.2g} at most", ""))  # fmt: skip
    rate = 1.0 / series.period
    head = f"{series.source}: {series.position_name}, {fit.samples} samples at {rate:.6g} Hz"
    written = picture.with_name("identification.json")
    lines = str(result.as_dict()["snippet"]).splitlines()
    return [
        Section(head, (), ()),
        Section("Noise", _head("parameter"), rows),
        Section("For the axis in the rig file", ("",), [(line,) for line in lines]),
        Section("Notes", ("",), [(note,) for note in result.notes]),
        Section("Files", ("",), [(str(written),), (str(picture),)]),
    ]


def contact_sections(result: Any, units: tuple[str, str], picture: Path) -> list[Any]:
    """Parameters of the chosen model, residuals of all, warnings and files."""
    from tautwave.cli.terminal.show import NOTE, Section

    place, effort = units
    fit = result.chosen
    per = f"{effort}/{place}" if place else ""
    word = {
        "stiffness": per if fit.name != "hunt_crossley" else f"{effort}/{place}^n" if place else "",
        "damping": f"{effort} s/{place}" if place else "",
        "mass": ("kg m^2" if place == "rad" else "kg") if place else "",
        "surface": place,
        "offset": effort,
        "preload": effort,
        "loss": f"s/{place}" if place else "",
    }
    rows = [_line(name, value, word.get(name, "")) for name, value in fit.parameters.items()]
    if fit.name == "hunt_crossley":
        rows.insert(0, _line("dF/dy deep in contact", fit.working_stiffness, per))
    rows.append(
        ("residual, rms", f"{fit.residual_rms:.3g}", f"{1 - fit.explained:.2%} of variance", effort)
    )
    models = [
        (
            other.name,
            f"{other.working_stiffness.value:.4g}",
            f"{other.residual_rms:.3g}",
            f"{other.explained:.1%}",
            "taken" if other is fit else "",
        )
        for other in result.fits
    ]
    name = fit.name.replace("_", "-")
    written = picture.with_name("identification.json")
    said = f"{result.series.source}: {name}, {result.series.effort_name}"
    side = "" if not fit.side else f", in contact {fit.contact_share:.0%} of the time"
    block = result.as_dict()["snippet"]
    return [
        Section(
            (said if result.found else f"{result.series.source}: no contact found") + side,
            (), (), "bold" if result.found else NOTE,
        ),
        Section("Fit", _head("parameter"), rows),
        Section("Models", ("model", ">stiffness", ">residual", ">explained", ""), models),
        Section("For simulation in a rig file", ("",), [] if block is None else [(block,)]),
        Section("Notes", ("",), [(note,) for note in result.notes]),
        Section("Files", ("",), [(str(written),), (str(picture),)]),
    ]  # fmt: skip
