"""Complete a run's summary from its recording: tracking, and energy books of both kinds.

The controller's books rest on measured positions and the efforts that were sent; the plant's on the
truth of a simulation. `residual` of either must vanish. `sensing_gap` is their difference at the
motors: what quantisation and noise hide from the controller.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tautwave.report.fast_motion import fast_shares
from tautwave.report.run.rebuild import rebuild_summary
from tautwave.report.run.rundir import Run, engaged_s, served_rows
from tautwave.summary import Summary, checked, plain_summary
from tautwave.summary import write_summary as write_file

_GAINS = ("hand_work", "motor_work")
_LOSSES = ("grip_loss", "viscous_loss", "coulomb_loss", "environment_loss")
_STORES = ("kinetic", "grip_stored", "environment_stored")
_AXIS = {**dict.fromkeys(_GAINS, 1.0), **dict.fromkeys(_STORES + _LOSSES, -1.0)}
_ARM = {"work": 1.0, "kinetic": -1.0, "potential": -1.0}


def complete_summary(run: Run) -> Summary:
    """Return a run's summary with what only its recording can tell."""
    summary = plain_summary(run.result)
    rebuilt = rebuild_summary(run)
    pairs = {name: dict(block) for name, block in summary.get("pairs", {}).items()}
    for name, block in rebuilt.get("pairs", {}).items():
        pairs.setdefault(name, {}).update(block)
    for name in run.pairs:
        shares = fast_shares(run, name)
        if shares:
            pairs.setdefault(name, {})["fast_share"] = shares
    summary["pairs"] = pairs
    if "recording" in summary:
        read = {"rows_read": run.rows, "truncated": run.truncated}
        summary["recording"] = {**summary["recording"], **read}
    leaks = [column.split(".") for column in run.columns if _is_load_leak(column)]
    carried = [".".join(words[1:-1]) for words in leaks]
    loads = {arm: load for arm in carried if (load := load_energy(run, arm))}
    if loads:
        summary["loads"] = loads
    energy = dict(rebuilt.get("energy_j", {}))
    energy.update(plant_energy(run, {name: power_ratio(block) for name, block in pairs.items()}))
    summary["energy_j"] = energy
    if "operation" in summary:
        summary["operation"] = {**summary["operation"], "engaged_s": engaged_s(run)}
    return checked(Summary, summary)


def write_summary(run: Run) -> None:
    """Replace `summary.json` by a run's summary.

    Raises
    ------
    WritingError
        It cannot be written.
    """
    write_file(run.directory, run.result)


def load_energy(run: Run, arm: str) -> dict[str, float]:
    """Return what carrying the loads of a side or arm did [J]; empty where none are carried.

    `potential` is what the loads hold more than at the start, `leak` what was taken out of the
    devices beyond that (below 0: given to them), `given` the most that was given at any time;
    `changed` what payloads taken up, or a felt load ramped in or out, put in, where there are some.
    """
    energies = {}
    for what in ("potential", "leak", "given", "changed"):
        values = run.read(f"load.{arm}.{what}").get(f"load.{arm}.{what}")
        if values is not None and len(values):
            energies[f"{what}_j"] = float(values[-1])
    return energies


def power_ratio(pair: dict[str, Any]) -> float:
    """Return the slave's energy per energy of the pair; 1 unless the rig scales power."""
    return float(pair.get("power_ratio", 1.0))


def plant_energy(run: Run, ratios: dict[str, float]) -> dict[str, float]:
    """Return the plant's residual and the sensing gap [J]; empty without a simulated truth.

    The residual adds up those of all axes, and of the arms whose joints some of them are.

    Parameters
    ----------
    run : Run
        The run.
    ratios : dict
        Power ratio by pair.
    """
    residual = 0.0
    gap: dict[str, float] = {}
    uncertainty = 0.0
    has_truth = False
    sides = [(pair, side) for pair in run.pairs for side in ("master", "slave")]
    sides += [(port, "master") for port in run.ports]
    for pair, side in sides:
        axis = f"{side}.{pair}"
        weight = 1.0 if side == "master" else 1.0 / ratios.get(pair, 1.0)
        spread = run.read(f"{axis}.uncertainty").get(f"{axis}.uncertainty")
        if spread is not None and len(spread):
            uncertainty += float(spread[-1])
        balance = _plant_balance(run, axis)
        hidden = sensing_gap(run, axis, weight)
        if balance is None or hidden is None:
            continue
        has_truth = True
        residual += abs(weight * balance)
        gap[axis] = hidden
    for arm in [name.removesuffix(".work") for name in run.columns if _is_arm_work(name)]:
        has_truth = True
        residual += _balance(run, {f"{arm}.{name}": sign for name, sign in _ARM.items()}) or 0.0
    figures = {"uncertainty": uncertainty}
    if has_truth:
        figures["plant_residual"] = residual
        figures["sensing_gap"] = sum(abs(value) for value in gap.values())
    return figures


def sensing_gap(run: Run, axis: str, weight: float) -> float | None:
    """Return what a port booked beyond what entered by the motor, None without its truth [J].

    Parameters
    ----------
    run : Run
        The run.
    axis : str
        Such as `slave.wrist`.
    weight : float
        Its pair's energy per energy of its own.
    """
    sent = run.read(f"{axis}.port_energy").get(f"{axis}.port_energy")
    motor = run.read(f"plant.{axis}.motor_work").get(f"plant.{axis}.motor_work")
    if sent is None or motor is None or not len(motor):
        return None
    # Between its slots the truth of a slow axis is ahead of the controller's samples.
    served = served_rows(run, axis)
    sent = sent[served] if len(sent[served]) else sent
    motor = motor[served] if len(motor[served]) else motor
    believed = float(sent[-1] - sent[0])
    carried = run.read(f"load.{axis}.energy").get(f"load.{axis}.energy")
    if carried is not None and len(carried):
        believed += weight * float(carried[-1] - carried[0])
    return believed + weight * float(motor[-1] - motor[0])


def _is_load_leak(name: str) -> bool:
    return name.startswith("load.") and name.endswith(".leak")


def _is_arm_work(name: str) -> bool:
    return name.startswith("arm.") and name.endswith(".work")


def _plant_balance(run: Run, axis: str) -> float | None:
    """Return the greatest imbalance of one axis' true energies over the run [J]."""
    return _balance(run, {f"plant.{axis}.{name}": sign for name, sign in _AXIS.items()})


def _balance(run: Run, signs: dict[str, float]) -> float | None:
    """Return the greatest change of a sum of energies over the run [J]."""
    total: np.ndarray[Any, np.dtype[np.float64]] | None = None
    for name, values in run.each(signs):
        if not len(values):
            return None
        change = signs[name] * (values - values[0])
        total = change if total is None else total + change
    return None if total is None else float(np.max(np.abs(total)))
