"""The certificate of a rig before its run, from a separate process.

The analysis stays out of the process that moves motors, which gets the certificate as data.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from tautwave.config import Rig, render_stiffness, resolved_yaml
from tautwave.errors import ConfigError, NotCertifiedError, UnchosenKeyError
from tautwave.rig import BusWay, real_buses
from tautwave.summary import checked
from tautwave.summary.model import Certificate
from tautwave.types import Choice

TIMEOUT_S = 120.0
UNCERTIFIED = "Use --allow-uncertified to run it anyway."

ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
"""Of small matrices; several wait for each other, and on a busy machine take ten times as long."""


def certificate_of(rig: Rig, ways: Mapping[str, BusWay]) -> dict[str, Any]:
    """Return the certificate of a rig as plain data; `passed` is None if there is none.

    It is that of the rig as its ways take it, `tautwave.rig.as_taken`. What the law chose for keys
    that are left to it is in `choices`: value and reason by path.

    Raises
    ------
    ConfigError
        The law cannot choose them.
    """
    try:
        child = subprocess.run(
            [sys.executable, "-m", "tautwave.certificate", *real_buses(ways)],
            input=resolved_yaml(rig),
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
            env={**ONE_THREAD, **os.environ},
        )
    except subprocess.TimeoutExpired:
        return _none(rig, f"it took more than {TIMEOUT_S:g} s")
    why = (child.stderr.strip().splitlines() or ["no reason given"])[-1]
    if child.returncode == UnchosenKeyError.exit_code:  # all else was checked when it was read
        raise ConfigError(f"{rig.source or rig.name}: {why}")
    if child.returncode != 0:
        return _none(rig, why)
    certificate: dict[str, Any] = json.loads(child.stdout)
    return certificate


def certificates_of(rigs: Sequence[Rig], ways: Mapping[str, BusWay]) -> list[dict[str, Any]]:
    """Return the certificates of several rigs, computed beside each other."""
    if not rigs:
        return []
    with ThreadPoolExecutor(len(rigs)) as pool:
        return list(pool.map(lambda rig: certificate_of(rig, ways), rigs))


def _none(rig: Rig, why: str) -> dict[str, Any]:
    sentence = f"{rig.name}: the certificate could not be computed: {why}"
    return {
        "passed": None,
        "state": "not evaluated",
        "require": rig.require,
        "verdicts": {},
        "sentences": [sentence],
        "elements": [],
        "loops": [],
        "walls": {},
        "choices": {},
    }


def certified_rig(rig: Rig, certificate: dict[str, Any]) -> Rig:
    """Return the rig as it will run: derated walls at the certified stiffness, `auto` its value."""
    choices = {path: Choice(*chosen) for path, chosen in certificate["choices"].items()}
    if choices:
        rig = rig.with_choices(choices)
    walls = certificate["walls"]
    return render_stiffness(rig, {axis: wall["rendered_stiffness"] for axis, wall in walls.items()})


def refuse_uncertified(rig: Rig, certificate: dict[str, Any], remedy: str = UNCERTIFIED) -> None:
    """Raise NotCertifiedError, with why and what to do, unless the required verdict holds."""
    if certificate["passed"]:
        return
    lines = [f"{rig.name}: not certified as {rig.require.replace('_', ' ')}, which it requires:"]
    lines += [f"  {sentence}" for sentence in certificate["sentences"]]
    lines.append(remedy)
    raise NotCertifiedError("\n".join(lines))


def summary_block(certificate: dict[str, Any], allowed: bool) -> Certificate:
    """Return the part of the certificate for the run's summary."""
    kept = {
        key: certificate[key]
        for key in ("passed", "state", "require", "verdicts", "sentences", "walls")
    }
    kept["elements"] = {
        element["name"]: {
            "passive": element["passive"]["state"],
            "passive_quantised": element["passive_quantised"]["state"],
            "sentences": element["sentences"],
            "true_j": element["numbers"].get("true_j"),
            **{
                name: element["numbers"][key]
                for name, key in (("reserve_j", "reserve"), ("leak_w", "leak"))
                if key in element["numbers"]
            },
        }
        for element in certificate["elements"]
    }
    kept["loops"] = {loop["pair"]: loop["verdict"] for loop in certificate["loops"]}
    kept["allowed_uncertified"] = allowed and not certificate["passed"]
    return checked(Certificate, kept)
