"""A change of a running rig's numbers: certified by another process, then left on its desk.

Two rigs have to be certified: the one that is asked for, and the corner of the way there, which has
the greater of what acts and what is asked for of every number. Knobs get there at their own pace, a
wall's stiffness perhaps only once it is left; whatever acts meanwhile is no greater than the corner
in any number, and smaller ones need no more of the device than greater ones do.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from tautwave.config import Rig, parse_rig, resolved_yaml
from tautwave.config.guard import parse_json
from tautwave.errors import ConfigError, NotCertifiedError
from tautwave.rig import axis_allowance, coupling_law
from tautwave.rig.clips import AT_ONCE
from tautwave.runtime.tuning.desk import last_left, leave
from tautwave.session.facts import port_claims
from tautwave.session.scales import scales_of
from tautwave.view.watched import Watched

TIMEOUT_S = 120.0
ROUNDING = 1.0 + 1e-9


class Asked(NamedTuple):
    """Values by path: `acting` now, on their `way` since the last set, `wanted` from now on."""

    acting: Mapping[str, float]
    way: Mapping[str, float]
    wanted: Mapping[str, float]
    ramped: Collection[str]

    @property
    def corner(self) -> dict[str, float]:
        """The greatest of them, for what goes there in steps."""
        return {
            path: max(value, self.acting[path], self.way[path]) if path in self.ramped else value
            for path, value in self.wanted.items()
        }


def asked_of(run: Watched, row: Sequence[float], values: Mapping[str, Any]) -> Asked:
    """Return what a viewer asks for, from the newest row and its message.

    Raises
    ------
    ConfigError
        The run allows no tuning, or not of that key, or a value is out of its range.
    """
    facts = run.facts.get("tuning")
    if facts is None:
        raise ConfigError("this run does not allow tuning; start it with --allow-tuning")
    knobs = {knob["path"]: knob for knob in facts["knobs"]}
    fixed = {one["path"]: one["when"] for one in facts["fixed"]}
    for path, value in values.items():
        name = str(path)[:100]
        if path in fixed:
            raise ConfigError(f"{name}: only {fixed[path]}; set it for the next run with --set")
        if path not in knobs:
            raise ConfigError(f"{name}: is never tuned")
        low, high, unit = (knobs[path][key] for key in ("low", "high", "unit"))
        if not _is_number(value) or not low <= value <= high:
            shown = repr(value)[:40]
            raise ConfigError(f"{name}: {low:g} to {high:g} {unit} (got {shown})")
    acting = {path: row[run.live.columns.index(knob["column"])] for path, knob in knobs.items()}
    left = last_left(facts["desk"], len(knobs))
    way = acting if left is None else dict(zip(knobs, left, strict=True))
    wanted = {**way, **{path: float(value) for path, value in values.items()}}
    return Asked(acting, way, wanted, {path for path, knob in knobs.items() if knob["ramped"]})


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


async def tune(run: Watched, rig: Rig, asked: Asked) -> str:
    """Certify a change and leave it on the run's desk; return a sentence.

    Raises
    ------
    NotCertifiedError
        It is not certified, in the certificate's words.
    """
    facts = run.facts["tuning"]
    wanted, corner = _certified(rig, asked.wanted), _certified(rig, asked.corner)
    changed = [path for path, value in asked.wanted.items() if value != asked.way[path]]
    if any(path in wanted for path in changed):
        sets = [wanted] if corner == wanted else [wanted, corner]
        rigs = (one for values in sets for one in at_every_scale(rig, values))
        jobs = (certify_change(*one, facts["hardware"]) for one in rigs)
        refusals = await asyncio.gather(*jobs, return_exceptions=True)
        there = len(refusals) // len(sets)
        for error in filter(None, refusals[:there]):
            raise error
        for error in filter(None, refusals[there:]):
            raise NotCertifiedError(
                f"certified there, but not in between: first lower, then raise. {error}"
            ) from error
    leave(facts["desk"], [asked.wanted[knob["path"]] for knob in facts["knobs"]])
    return ", ".join(f"{path} {asked.wanted[path]:g}" for path in changed) or "nothing changes"


def _certified(rig: Rig, values: Mapping[str, float]) -> dict[str, float]:
    """Leave out effort limits, below that of the rig its certificate holds as it is.

    Not so where both ends of a pair are clipped alike: how far depends on both limits. What is
    tuned is the ceiling of wall and coupling; a rig's limit is of its load too.
    """
    kept = rig.scene is None and coupling_law(rig).alike
    wanted = {path: value for path, value in values.items() if kept or not _is_limit(path)}
    for path in filter(_is_limit, wanted):
        side, _, name, _ = path.split(".")
        has = axis_allowance(rig, f"{side}.{name}", AT_ONCE)
        wanted[path] = min(wanted[path] + has.load_effort, has.effort)
    return wanted


def _is_limit(path: str) -> bool:
    return path.endswith(".effort_limit")


def with_values(rig: Rig, values: Mapping[str, float]) -> Rig:
    """Return a rig with other values at some paths, checked as a rig file is."""
    overrides = [f"{path}={value!r}" for path, value in values.items()]
    return parse_rig(resolved_yaml(rig), rig.source or "rig.yaml", overrides)


def at_every_scale(rig: Rig, values: Mapping[str, float]) -> Iterator[tuple[Rig, Rig]]:
    """Yield a rig as it is and as it would be, at each scale that a person may choose."""
    changed = with_values(rig, values)
    yield from zip((rig, *scales_of(rig)), (changed, *scales_of(changed)), strict=True)


async def certify_change(rig: Rig, changed: Rig, hardware: Sequence[str]) -> None:
    """Certify a changed rig in a process of its own.

    Raises
    ------
    NotCertifiedError
        It is not certified, or claims another energy than the run states.
    """
    _keep_claims(rig, changed)
    child = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "tautwave.certificate", *hardware,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        async with asyncio.timeout(TIMEOUT_S):
            out, errors = await child.communicate(resolved_yaml(changed).encode())
    except TimeoutError as error:
        child.kill()
        raise NotCertifiedError(f"no certificate within {TIMEOUT_S:g} s") from error
    if child.returncode != 0:
        raise NotCertifiedError(errors.decode("utf-8", "replace").strip() or "no certificate")
    certificate = parse_json(out.decode())
    if not certificate["passed"]:
        raise NotCertifiedError(" ".join(certificate["sentences"]))
    for axis, wall in certificate["walls"].items():
        if wall["rendered_stiffness"] < wall["asked_stiffness"]:
            least = wall["rendered_stiffness"]
            raise NotCertifiedError(f"wall of {axis}: certified up to a stiffness of {least:.4g}")


def _keep_claims(rig: Rig, changed: Rig) -> None:
    """Refuse a change with which a port would claim more than it did before the run.

    What a wall may owe is that of the run's first walls, however stiff they become
    (`laws.wall.hold_wall`).
    """
    delays = dict.fromkeys(rig.axes, AT_ONCE)
    changed = _with_walls_of(rig, changed)
    for name in rig.coupling.pairs:
        before = port_claims(rig, name, delays).get("claim_j", {})
        after = port_claims(changed, name, delays).get("claim_j", {})
        for side, claim in after.items():
            if claim > before[side] * ROUNDING:
                raise NotCertifiedError(
                    f"{side}.{name}: its port would claim {claim:.4g} J, more than the "
                    f"{before[side]:.4g} J stated before the run"
                )


def _with_walls_of(rig: Rig, changed: Rig) -> Rig:
    """Return a changed rig with the local walls of another."""
    pairs = {
        name: pair.model_copy(
            update={
                key: getattr(rig.coupling.pairs[name], key) for key in ("wall_master", "wall_slave")
            }
        )
        for name, pair in changed.coupling.pairs.items()
    }
    coupling = changed.coupling.model_copy(update={"pairs": pairs})
    return changed.model_copy(update={"coupling": coupling})
