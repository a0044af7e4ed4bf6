"""What `tautwave identify` prints of a device, a lever, an encoder's noise or a contact."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def _line(name: str, estimate: Any, unit: str) -> tuple[str, str, str, str]:
    return name, f"{estimate.value:.5g}", f"{estimate.lower:.5g} to {estimate.upper:.5g}", unit


def _head(what: str) -> tuple[str, str, str, str]:
    return what, ">value", ">95 % interval", ""


def device_sections(result: Any, units: tuple[str, str], picture: Path) -> list[Any]:
    """Parameters, lines for the rig file, warnings and files of an identified device."""
    from tautwave.tables import Table

    place, effort = units
    fit = result.fit
    mass = "kg m^2" if place == "rad" else "kg"
    rows = [
        _line("inertia", fit.inertia, mass),
        _line("viscous damping", fit.damping, f"{effort} s/{place}"),
        _line("Coulomb friction", fit.coulomb, effort),
        _line("constant external effort", fit.bias, effort),
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
        Table(f"{result.axis}: {how}", (), ()),
        Table("Device", _head("parameter"), rows),
        Table(f"For {key} in the rig file", ("",), [(t,) for t in _lines_of(result)]),
        Table("Notes", ("",), [(note,) for note in result.notes]),
        Table("Files", ("",), [(str(result.directory / "identification.json"),), (str(picture),)]),
    ]


def _lines_of(result: Any) -> list[str]:
    return str(result.as_dict()["snippet"]).splitlines()


def noise_sections(result: Any, unit: str, picture: Path) -> list[Any]:
    """Step, deviation and colour of an encoder's noise, lines for the rig file, files."""
    from tautwave.tables import Table

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
        Table(head, (), ()),
        Table("Noise", _head("parameter"), rows),
        Table("For the axis in the rig file", ("",), [(line,) for line in lines]),
        Table("Notes", ("",), [(note,) for note in result.notes]),
        Table("Files", ("",), [(str(written),), (str(picture),)]),
    ]


def contact_sections(result: Any, units: tuple[str, str], picture: Path) -> list[Any]:
    """Parameters of the chosen model, residuals of all, warnings and files."""
    from tautwave.tables import NOTE, Table

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
        "lag": "s",
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
        Table(
            (said if result.found else f"{result.series.source}: no contact found") + side,
            (), (), level="" if result.found else NOTE,
        ),
        Table("Fit", _head("parameter"), rows),
        Table("Models", ("model", ">stiffness", ">residual", ">explained", ""), models),
        Table("For simulation in a rig file", ("",), [] if block is None else [(block,)]),
        Table("Notes", ("",), [(note,) for note in result.notes]),
        Table("Files", ("",), [(str(written),), (str(picture),)]),
    ]  # fmt: skip


def lever_sections(result: Any, units: tuple[str, str], picture: Path) -> list[Any]:
    """Parameters, encoder, lines for the rig file, warnings and files of a recorded lever."""
    from tautwave.tables import Table

    place, effort = units
    fit, series = result.fit, result.series
    mass = {"rad": "kg m^2", "m": "kg"}.get(place, "")
    rows = [
        _line("inertia", fit.inertia, mass),
        _line("viscous damping", fit.damping, f"{effort} s/{place}" if place else ""),
        _line("Coulomb friction", fit.coulomb, effort),
        _line("constant external effort", fit.bias, effort),
    ]
    if fit.weight is not None:
        rows.append(_line("weight, cosine of the position", fit.weight[0], effort))
        rows.append(_line("weight, sine of the position", fit.weight[1], effort))
    if fit.outside is not None:
        rows.append(_line(f"effort per unit of {result.outside_name}", fit.outside, effort))
        rows.append(_line("reading at zero effort", result.sensor_offset, effort))
    rest = f"{1 - fit.explained:.2%} of variance"
    rows.append(("residual, rms", f"{fit.residual_rms:.3g}", rest, effort))
    step = f"{result.quantum:.5g}" if result.quantum > 0.0 else "none"
    encoder = [
        ("encoder step", step, "", place),
        _line("noise, standard deviation", result.noise, place),
    ]
    how = f"{len(series.position)} samples, up to {fit.peak_velocity:.3g} {place or 'units'}/s"
    written = picture.with_name("identification.json")
    return [
        Table(f"{series.source}: {series.position_name}, {how}", (), ()),
        Table(f"Lever, moved by {series.effort_name}", _head("parameter"), rows),
        Table("Encoder", _head("parameter"), encoder),
        Table("For the axis in the rig file", ("",), [(t,) for t in result.snippet.splitlines()]),
        Table("Notes", ("",), [(note,) for note in result.notes]),
        Table("Files", ("",), [(str(written),), (str(picture),)]),
    ]
