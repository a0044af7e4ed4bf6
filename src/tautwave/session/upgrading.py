"""What was said of a rig in an older run, beside what is said now, and the keys that make it so."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config import Rig
from tautwave.config.text.document import read_text
from tautwave.config.text.resolved import flow_yaml, resolved_yaml
from tautwave.config.text.yaml12 import parse_yaml
from tautwave.session.certified import summary_block
from tautwave.summary import read_summary
from tautwave.summary.model import Certificate

OF_ONE_RUN = ("format", "name", "duration_s")
"""Keys that are another run's business."""

NOT_SAID = "not said"


class ChangedKey(NamedTuple):
    """A key whose value was another: as YAML, '' where there was or is none.

    `keeps` is the option that keeps the former value, '' where it is no key any more.
    """

    key: str
    then: str
    now: str
    keeps: str


class Against(NamedTuple):
    """What differs between a run and the same rig now.

    Attributes
    ----------
    version : str
        Of tautwave, that ran it.
    verdicts : tuple of (what, then, now)
        The certificate as a whole, each verdict, element and loop; only those that differ.
    alike : int
        Verdicts, elements and loops about which the same is said.
    keys : tuple of ChangedKey
        Keys that differ, with every default made explicit.
    """

    version: str
    verdicts: tuple[tuple[str, str, str], ...]
    alike: int
    keys: tuple[ChangedKey, ...]


def compare_with_run(directory: Path, rig: Rig, certificate: Mapping[str, Any]) -> Against:
    """Hold a rig and its certificate against those of a run.

    Parameters
    ----------
    directory : Path
        Of the run.
    rig : Rig
        As it is checked now, with what its law chose.
    certificate : mapping
        Of `session.check`.

    Raises
    ------
    ConfigError
        The directory has no rig or no summary that can be read.
    RecordingError
        Its summary is of a newer version.
    """
    summary, _ = read_summary(directory)
    then = dict(_flat(parse_yaml(read_text(directory / "rig.yaml")).value))
    now = dict(_flat(parse_yaml(resolved_yaml(rig)).value))
    before = _said(summary.certificate)
    after = _said(summary_block(dict(certificate), allowed=False))
    names = [*before, *(name for name in after if name not in before)]
    said = [(name, before.get(name, NOT_SAID), after.get(name, NOT_SAID)) for name in names]
    differing = tuple(one for one in said if one[1] != one[2])
    return Against(
        summary.version or "unknown version",
        differing,
        len(said) - len(differing),
        tuple(_keys(then, now)),
    )


def _said(certificate: Certificate) -> dict[str, str]:
    """Return each statement of a certificate, in a word or two."""
    verdicts = {f"required: {certificate.require}": certificate.state}
    verdicts |= {name.replace("_", " "): one.state for name, one in certificate.verdicts.items()}
    verdicts |= {name: one.passive or NOT_SAID for name, one in certificate.elements.items()}
    verdicts |= {f"loop of {name}": one.state for name, one in certificate.loops.items()}
    return verdicts


def _flat(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values below mappings, by path."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from _flat(inner, f"{path}.{key}" if path else str(key))
    else:
        yield path, value


def _keys(then: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[ChangedKey]:
    for key, value in then.items():
        if key in OF_ONE_RUN or (key in now and now[key] == value):
            continue
        text = flow_yaml(value)
        if key in now:
            yield ChangedKey(
                key, text, flow_yaml(now[key]), f"--set {shlex.quote(f'{key}={text}')}"
            )
        elif value is not None:
            yield ChangedKey(key, text, "", "")
    for key, value in now.items():
        if key not in then and key not in OF_ONE_RUN and value is not None:
            yield ChangedKey(key, "", flow_yaml(value), "")
