"""Rigs to certify: the README's, changed by `--set`."""

from __future__ import annotations

from pathlib import Path

from tautwave.certificate import Certificate, Element, certify
from tautwave.config import Rig, load_rig

CONFIGS = Path(__file__).parents[2] / "configs"
README_RIG = CONFIGS / "bench-1dof-loopback.yaml"
PAIR = "coupling.pairs.lever"
NO_QUANTUM = ("master.axes.lever.encoder_quantum=0", "slave.axes.lever.encoder_quantum=0")
NO_WALLS = (f"{PAIR}.wall_master=", f"{PAIR}.wall_slave=")


def rig(*changes: str, name: str = "bench-1dof-loopback") -> Rig:
    return load_rig(CONFIGS / f"{name}.yaml", changes)


def certified(*changes: str, name: str = "bench-1dof-loopback") -> Certificate:
    return certify(rig(*changes, name=name))


def wall(stiffness: float, damping: float = 0.0, *more: str, side: str = "slave") -> str:
    keys = [f"position: -0.28, stiffness: {stiffness!r}, damping: {damping!r}, side: below", *more]
    return f"{PAIR}.wall_{side}={{{', '.join(keys)}}}"


def element(certificate: Certificate, name: str) -> Element:
    [found] = [e for e in certificate.elements if e.name == name]
    return found


def friction_of(value: float | str) -> str:
    """Coulomb friction that is believed of the slave."""
    return f"slave.axes.lever.coulomb={value}"
