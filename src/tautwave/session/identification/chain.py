"""`identify RECORDING --chain`: masses of a whole chain from how it moved under its motors."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.analysis.identification.chain_model import ChainFit, FoundBody, fit_chain
from tautwave.analysis.identification.plausible import implausible
from tautwave.analysis.identification.regression import Array
from tautwave.config import load_rig
from tautwave.config.inputs.chains import chain_links, held_at_tip
from tautwave.config.inputs.urdf import read_urdf
from tautwave.errors import ConfigError, RecordingError
from tautwave.models.chain.build import Body, Link, build_chain
from tautwave.models.chain.params import ChainParams
from tautwave.recordings.columns import column_names, is_own, recording_file
from tautwave.recordings.stated import UNSTATED, Stated
from tautwave.session.identification.recorded_columns import (
    Series,
    changing,
    read_series,
    too_little,
    with_beside,
)
from tautwave.session.identification.weighing import CENTRES, bodies_of

FILTER_HZ = 10.0
RATE_SHARE = 0.02
DELAYS = (-1.0, 0.0, 1.0, 2.0)
"""Periods after which a logged effort may act, below 0: it was measured. The best is taken."""
DOUBTFUL = 0.9
WORSE = 1.5
"""Times the residual of base parameters that bodies which can exist may leave without a doubt."""
DOWN = (0.0, 0.0, -9.81)
PLACES = ("position", "pos", "angle")
EFFORTS = ("motor_effort", "commanded", "effort", "torque", "force")


class Inertial(NamedTuple):
    """A body in its link's frame: mass [kg], centre [m], inertia about that centre [kg m^2]."""

    mass: float
    centre: Array
    inertia: Array


class ChainResult(NamedTuple):
    """A chain: its fit, its joints, and the columns that it was found from."""

    source: str
    chain: str
    joints: tuple[str, ...]
    columns: tuple[tuple[str, str], ...]
    fit: ChainFit
    inertials: tuple[Inertial, ...]
    is_urdf: bool
    delay: float
    turned: bool
    samples: int
    rate_hz: float
    filter_hz: float
    notes: list[str]

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        fit = self.fit
        return {
            "kind": "chain",
            "source": self.source,
            "chain": self.chain,
            "joints": {
                name: list(pair) for name, pair in zip(self.joints, self.columns, strict=True)
            },
            "samples": self.samples,
            "rate_hz": self.rate_hz,
            "filter_hz": self.filter_hz,
            "effort_turned": self.turned,
            "delay_periods": self.delay,
            "base_parameters": [
                {
                    "name": fit.base.name(number, self.joints),
                    "found": estimate._asdict(),
                    "believed": float(believed),
                    "told": told,
                }
                for number, (estimate, believed, told) in enumerate(
                    zip(fit.found, fit.believed, fit.told, strict=True)
                )
            ],
            "bodies": [
                {
                    "joint": name,
                    "mass": body.mass._asdict(),
                    "centre": one.centre.tolist(),
                    "inertia": one.inertia.tolist(),
                }
                for name, body, one in zip(self.joints, fit.bodies, self.inertials, strict=True)
            ],
            "friction": {
                name: {
                    word: value._asdict()
                    for word, value in zip(("coulomb", "damping", "offset"), three, strict=True)
                }
                for name, three in zip(self.joints, fit.friction, strict=True)
            },
            "residual_rms": dict(zip(self.joints, fit.residual, strict=True)),
            "residual_rms_of_bodies": dict(zip(self.joints, fit.bodies_residual, strict=True)),
            "explained": fit.explained,
            "snippet": self.snippet,
            "notes": self.notes,
        }

    @property
    def implausible(self) -> list[str]:
        """A sentence for each mass and centre that no link has."""
        sentences = []
        for name, one in zip(self.joints, self.inertials, strict=True):
            values = {"link_mass": one.mass, "centre": float(np.linalg.norm(one.centre))}
            sentences += [f"{name}: {doubt}" for doubt in implausible(values, rotary=True)]
        return sentences

    @property
    def snippet(self) -> str:
        """Return the bodies as lines for the URDF's links, or for the rig's rows."""
        if self.implausible or self.fit.explained < DOUBTFUL or self.misfit:
            return f"# {self.chain}: nothing here is credible, see the notes"
        lines = []
        for name, one in zip(self.joints, self.inertials, strict=True):
            x, y, z = (f"{value:.5g}" for value in one.centre)
            (xx, xy, xz), (_, yy, yz), (_, _, zz) = (
                tuple(f"{value:.4g}" for value in row) for row in one.inertia
            )
            if self.is_urdf:
                lines.append(
                    f'{name}: <origin xyz="{x} {y} {z}"/><mass value="{one.mass:.5g}"/>'
                    f'<inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/>'
                )
            else:
                lines.append(
                    f"{name}: mass: {one.mass:.5g}, centre: [{x}, {y}, {z}], "
                    f"inertia: [{xx}, {yy}, {zz}, {xy}, {xz}, {yz}]"
                )
        return "\n".join(lines)

    @property
    def misfit(self) -> bool:
        """Whether no bodies that can exist say what the efforts say."""
        pairs = zip(self.fit.residual, self.fit.bodies_residual, strict=True)
        return any(bodies > WORSE * base for base, bodies in pairs)


def identify_chain(
    source: Path,
    *,
    chain: str,
    tip: str | None = None,
    position: str | None = None,
    effort: str | None = None,
    time: str | None = None,
    filter_hz: float | None = None,
    begin_s: float | None = None,
    end_s: float | None = None,
    stated: Stated = UNSTATED,
) -> ChainResult:
    """Fit the bodies of a chain that moved freely.

    Parameters
    ----------
    chain : str
        A URDF file, or `master`, `slave` or, of several, such as `master.left`: an arm of the rig
        beside a run's recording. Its masses are what is believed.
    tip : str, optional
        Last link of a chain in the URDF file.
    position, effort : str, optional
        Columns from base to tip, separated by commas; by default those that name the joints.
    time : str, optional
        Column of the time.
    filter_hz : float, optional
        Cut-off of the filter on motion and efforts [Hz]; default 10, at most a fiftieth of the
        rate.
    begin_s, end_s : float, optional
        Part of the recording [s on its own clock].
    stated : Stated
        What the file does not say itself.

    Raises
    ------
    ConfigError, RecordingError
        Not readable, ambiguous columns, too short, or a joint hardly moved.
    """
    links, gravity, tool, axes, is_urdf = _links_of(source, chain, tip)
    joints = tuple(link.name for link in links if link.kind != "fixed")
    columns = _columns(source, axes or joints, position, effort, stated)
    series, places, efforts = _read(source, columns, time, (begin_s, end_s), stated)
    cutoff = min(filter_hz or FILTER_HZ, RATE_SHARE / series.period)
    built = build_chain(links, gravity, tool)

    def fitted(delay: float, sign: float) -> ChainFit:
        try:
            return fit_chain(
                built, places, [sign * one for one in efforts], series.period,
                cutoff_hz=cutoff, delay=delay, known=series.known,
            )  # fmt: skip
        except ValueError as err:
            why = str(err)
            for number, name in enumerate(joints, 1):
                why = why.replace(f"joint {number} ", f"joint {name} ")
            raise too_little(series, ValueError(why)) from err

    trials = {sign: fitted(DELAYS[0], sign) for sign in (1.0, -1.0)}
    sign = max(trials, key=lambda one: _helps(trials[one]))
    fits = {DELAYS[0]: trials[sign]} | {delay: fitted(delay, sign) for delay in DELAYS[1:]}
    delay = min(fits, key=lambda one: sum(fits[one].residual))
    fit = fits[delay]
    inertials = tuple(
        _in_link(links, index, number, gravity, body)
        for number, (index, body) in enumerate(zip(bodies_of(links), fit.bodies, strict=True))
    )
    result = ChainResult(
        str(source), chain, joints, columns, fit, inertials, is_urdf, delay, sign < 0.0,
        len(series.position), 1.0 / series.period, cutoff, [],
    )  # fmt: skip
    return result._replace(notes=[*series.notes, *result.implausible, *_doubts(result)])


def _helps(fit: ChainFit) -> float:
    """Return how much friction resists: with an effort of the wrong sign it helps."""
    return sum(coulomb.value + viscous.value for coulomb, viscous, _ in fit.friction)


def _links_of(
    source: Path, chain: str, tip: str | None
) -> tuple[tuple[Link, ...], tuple[float, float, float], Body, tuple[str, ...], bool]:
    """Return links, gravity, what is held at the tip, axes of our own recording, and the kind."""
    side = chain.partition(".")[0]
    named = chain not in ("master", "slave") and Path(chain).is_file()
    if side not in ("master", "slave") or named:
        if not Path(chain).is_file():
            raise ConfigError(
                f"--chain {chain}: no such file; give a URDF file, or master or slave of a run"
            )
        return read_urdf(Path(chain), tip).links, DOWN, Body(), (), True
    if tip is not None:
        raise ConfigError("--tip: the rig states the tip of its arm; it is for a URDF file")
    beside = (source if source.is_dir() else source.parent) / "rig.yaml"
    if not is_own(recording_file(source)) or not beside.is_file():
        raise ConfigError(f"--chain {chain}: {source} is no run with its rig; give a URDF file")
    rig = load_rig(beside, choose=False)
    arms = {arm.name: arm for arm in rig.arms(side)}
    if not arms:
        raise ConfigError(f"{beside}: {chain} has no arm; give its URDF file with --chain")
    if chain not in arms:
        raise ConfigError(
            f"--chain {chain}: no such file, and the arms of {beside} are {', '.join(arms)}; give "
            "one of them, or a URDF file"
        )
    keys, axes = arms[chain].keys, arms[chain].axes
    links, _ = chain_links(keys)
    return links, keys.gravity, held_at_tip(keys), axes, keys.urdf is not None


def _columns(
    source: Path,
    joints: Sequence[str],
    position: str | None,
    effort: str | None,
    stated: Stated,
) -> tuple[tuple[str, str], ...]:
    """Return the columns of position and effort of each joint."""
    file = recording_file(source)
    if not file.exists():
        raise RecordingError(f"{source}: no such recording")
    header = column_names(file, stated)
    columns = []
    for what, given, words, option in (
        ("position", position, PLACES, "--position"),
        ("motor's effort", effort, EFFORTS, "--effort"),
    ):
        if given is None:
            columns.append([_named(file, header, one, words, what, option) for one in joints])
            continue
        names = [name.strip() for name in given.split(",")]
        if len(names) != len(joints) or not set(names) <= set(header):
            wrong = next((name for name in names if name not in header), None)
            why = (
                f"there is no column {wrong!r}; there are {', '.join(header)}" if wrong else
                f"{len(names)} columns for {len(joints)} joints, from base to tip: "
                f"{', '.join(joints)}"
            )  # fmt: skip
            raise ConfigError(f"{file}: {option}: {why}")
        columns.append(names)
    return tuple(zip(*columns, strict=True))


def _named(
    file: Path, header: Sequence[str], joint: str, words: Sequence[str], what: str, option: str
) -> str:
    """Return the one column that names a joint and a word, of the first word that any has."""
    whole = re.compile(rf"(?<![A-Za-z0-9]){re.escape(joint)}(?![A-Za-z0-9])")
    about = [name for name in header if whole.search(name) and not name.startswith("true.")]
    for word in words:
        able = [name for name in about if re.search(rf"(?<![a-z]){word}(?![a-z])", name.lower())]
        if len(able) == 1:
            return able[0]
        if able:
            break
    else:
        able = []
    said = f"several are ({', '.join(able)})" if able else "none does"
    raise ConfigError(
        f"{file}: which column is the {what} of joint {joint}? By their names {said}; give all "
        f"from base to tip with {option} A,B,... (there are {', '.join(header)})"
    )


def _read(
    source: Path,
    columns: Sequence[tuple[str, str]],
    time: str | None,
    part: tuple[float | None, float | None],
    stated: Stated,
) -> tuple[Series, list[Array], list[Array]]:
    """Return all columns on one grid, known where all are."""
    first = columns[0]
    series = changing(read_series(source, *first, time, None, part, stated))
    places, efforts = [series.position], [series.effort]
    for place, effort in columns[1:]:
        for name, kept in ((place, places), (effort, efforts)):
            series, values = with_beside(series, source, name, time, None, stated)
            kept.append(values)
    return series, places, efforts


def _in_link(
    links: Sequence[Link],
    index: int,
    number: int,
    gravity: tuple[float, float, float],
    body: FoundBody,
) -> Inertial:
    """Return a body in the frame in which the file has it."""

    def seen(centre: tuple[float, float, float]) -> Array:
        bare = [link._replace(body=Body()) for link in links]
        bare[index] = bare[index]._replace(body=Body(1.0, centre))
        return np.array(_chain(bare, gravity).joints[number][8:11])

    origin, *ends = (seen(centre) for centre in CENTRES)
    turn = np.stack([end - origin for end in ends], axis=1)
    mass, mx, my, mz, xx, yy, zz, xy, xz, yz = body.parameters
    centre = np.array([mx, my, mz]) / mass
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    about = about - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return Inertial(float(mass), turn.T @ (centre - origin), turn.T @ about @ turn)


def _chain(links: Sequence[Link], gravity: tuple[float, float, float]) -> ChainParams:
    return build_chain(tuple(links), gravity)


def _doubts(result: ChainResult) -> list[str]:
    fit = result.fit
    notes = [
        "No motion tells single masses apart, only the sums above; bodies are those nearest to "
        "what the file says that can exist and say the same."
    ]
    if result.turned:
        notes.append("The efforts count against the positions: their sign was inverted.")
    untold = [fit.base.name(at, result.joints) for at, told in enumerate(fit.told) if not told]
    if untold:
        notes.append(
            f"{len(untold)} of {len(fit.told)} base parameters are as believed, this motion does "
            f"not tell them: {'; '.join(untold)}. Move the joints before and behind them more, and "
            "faster."
        )
    if fit.explained < DOUBTFUL:
        notes.append(
            f"Doubtful: only {fit.explained:.0%} of a joint's effort is explained; something else "
            "(a hand, a contact, a wrong order of joints or unit) acts. Choose a free part with "
            "--from and --to."
        )
    if result.misfit:
        notes.append(
            "Doubtful: no bodies that can exist say what the efforts say; a sign, a unit or a gear "
            "ratio of one joint is wrong, or the file's geometry is another arm's."
        )
    return notes
