"""Run directories as a rig would leave them, made from a small simulation of its own.

Nothing of the framework runs here: two masses, a hand, a delay line and a wall, stepped plainly, so
that the report is tested against signals that look real, with numbers that are known.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from tautwave.runtime.mcap_file import McapFile

Columns = dict[str, NDArray[np.float64]]
RATE_HZ = 1000.0
ELEMENTS = ("port_master", "port_slave", "line", "wall_slave")


def simulate_pair(
    pair: str,
    rows: int,
    delay: int,
    *,
    impedance: float = 6.0,
    seed: int = 1,
    wall_at: float = 0.08,
) -> Columns:
    """Columns of one pair: the hand swings, the slave meets a wall at `wall_at` [m]."""
    rng = np.random.default_rng(seed)
    step, mass, damping = 1.0 / RATE_HZ, 0.35, 1.5
    time = np.arange(rows) * step
    reference = 0.055 * (1 - np.cos(2 * math.pi * 0.45 * time)) + 0.008 * np.sin(7.3 * time + seed)
    names = [f"{side}.{pair}.{what}" for side in ("master", "slave") for what in _AXIS]
    names += [f"slave.{pair}.wall_effort", f"{pair}.position_error", f"{pair}.effort_error"]
    names += [f"{pair}.{e}.{a}" for e in ELEMENTS for a in ("absorbed", "stored", "dissipated")]
    names += [f"true.{s}.{pair}.{w}" for s in ("master", "slave") for w in ("position", "velocity")]
    names += [f"true.master.{pair}.{w}" for w in ("reference", "hand_effort")]
    names += [f"true.slave.{pair}.environment_effort"]
    names += [f"plant.{s}.{pair}.{w}" for s in ("master", "slave") for w in _PLANT]
    out: Columns = {name: np.zeros(rows) for name in names}
    root = math.sqrt(2 * impedance)
    forth, back = np.zeros(max(delay, 1)), np.zeros(max(delay, 1))
    x, v = np.zeros(2), np.zeros(2)
    wave_out, force = np.zeros(2), np.zeros(2)
    books = {e: np.zeros(3) for e in ELEMENTS}
    plant = {s: dict.fromkeys(_PLANT, 0.0) for s in ("master", "slave")}
    work, flow = np.zeros(2), np.zeros(2)
    last = 0.0
    for k in range(rows):
        slot = k % len(forth)
        arriving = np.array([back[slot], forth[slot]])
        forth[slot], back[slot] = wave_out
        books["line"][:2] -= 0.5 * step * float(np.sum(arriving**2))
        force = root * arriving - impedance * v
        wall = max(0.0, 900.0 * (x[1] - 0.095)) if x[1] > 0.095 else 0.0
        depth = x[1] - wall_at
        contact = max(0.0, 1500.0 * depth + 4.0 * v[1]) if depth > 0 else 0.0
        hand = 538.0 * (reference[k] - x[0]) + 5.0 * ((reference[k] - last) / step - v[0])
        last = reference[k]
        outside = np.array([hand, -contact - wall])
        acceleration = (force + outside - damping * v) / mass
        moved = v + acceleration * step
        dx = 0.5 * (v + moved) * step
        for i, side in enumerate(("master", "slave")):
            at = f"{side}.{pair}."
            wave_out[i] = root * dx[i] / step - arriving[i] if k else 0.0
            mechanical = -force[i] * dx[i]
            port = mechanical - 0.5 * step * (wave_out[i] ** 2 - arriving[i] ** 2)
            # The account's own rounding, so that the balance has something to show.
            books[f"port_{side}"] += (port, 0.0, port + rng.normal(0.0, 2e-17))
            out[at + "position"][k] = round(x[i] / 2e-5) * 2e-5
            out[at + "velocity"][k] = v[i]
            out[at + "commanded"][k] = force[i] - (wall if i else 0.0)
            out[at + "port_effort"][k] = -force[i]
            out[at + "wave_in"][k], out[at + "wave_out"][k] = arriving[i], wave_out[i]
            out[at + "valid"][k] = 1.0
            work[i] += mechanical + (wall * dx[i] if i else 0.0)
            flow[i] += abs(mechanical)
            out[at + "port_energy"][k], out[at + "gross_flow"][k] = work[i], flow[i]
            out[f"true.{at}position"][k], out[f"true.{at}velocity"][k] = x[i], v[i]
            plant[side]["hand_work"] += hand * dx[i] if i == 0 else 0.0
            plant[side]["motor_work"] += force[i] * dx[i]
            plant[side]["viscous_loss"] += damping * v[i] * dx[i]
            plant[side]["kinetic"] = 0.5 * mass * moved[i] ** 2
            plant[side]["environment_stored"] = 750.0 * max(0.0, depth) ** 2 if i else 0.0
            for what, energy in plant[side].items():
                out[f"plant.{at}{what}"][k] = energy
        books["line"][:2] += 0.5 * step * float(np.sum(wave_out**2))
        held = 0.5 * 900.0 * max(0.0, x[1] + dx[1] - 0.095) ** 2
        taken = wall * dx[1]
        books["wall_slave"] += (taken, held - books["wall_slave"][1], 0.0)
        books["wall_slave"][2] = books["wall_slave"][0] - held
        for element, account in books.items():
            for what, energy in zip(("absorbed", "stored", "dissipated"), account, strict=True):
                out[f"{pair}.{element}.{what}"][k] = energy
        out[f"slave.{pair}.wall_effort"][k] = wall
        out[f"{pair}.position_error"][k] = x[0] - x[1]
        out[f"{pair}.effort_error"][k] = -force[0] - force[1]
        out[f"true.master.{pair}.reference"][k] = reference[k]
        out[f"true.master.{pair}.hand_effort"][k] = hand
        out[f"true.slave.{pair}.environment_effort"][k] = -contact
        x, v = x + dx, moved
    lost = rng.random(rows) < 0.002
    out[f"slave.{pair}.valid"][lost] = 0.0
    return out


_AXIS = ("position", "velocity", "commanded", "port_effort", "wave_in", "wave_out", "valid")
_AXIS += ("port_energy", "gross_flow")
_PLANT = ("hand_work", "motor_work", "kinetic", "environment_stored", "viscous_loss")


def timing(rows: int, seed: int = 7) -> Columns:
    """Clock columns of a loop with the hiccups of an ordinary machine."""
    rng = np.random.default_rng(seed)
    lateness = 18.0 + rng.gamma(2.0, 6.0, rows)
    compute = 52.0 + rng.gamma(3.0, 5.0, rows)
    hiccups = rng.random(rows) < 0.002
    lateness[hiccups] += np.minimum(rng.exponential(300.0, int(hiccups.sum())), 880.0)
    skipped = np.zeros(rows)
    skipped[rng.choice(rows, 3, replace=False)] = 1.0
    time = (np.arange(rows) + np.cumsum(skipped)) / RATE_HZ
    return {
        "time_s": time,
        "lateness_us": lateness,
        "compute_us": compute,
        "skipped_slots": skipped,
    }


def rig(pairs: tuple[str, ...], delay: int, **top: Any) -> dict[str, Any]:
    """The resolved rig that belongs to the columns."""
    axis = {
        "bus": "bench",
        "kind": "linear",
        "causality": "impedance",
        "inertia": {"value": 0.35, "lower": 0.3, "source": "identified"},
        "effort_limit": 40.0,
    }
    axes = {pair: {**axis, "id": i + 1} for i, pair in enumerate(pairs)}
    wall = {"position": 0.095, "stiffness": 900.0, "damping": 0.0, "side": "above"}
    reported = {"wave_impedance": 6.0, "position_scale": 1.0, "sign": 1, "wall_slave": wall}
    return {
        "name": "bench-1dof",
        "rate_hz": RATE_HZ,
        "duration_s": 10.0,
        "buses": {"bench": {"driver": "loopback", "options": {}}},
        "master": {"axes": axes},
        "slave": {"axes": axes},
        "coupling": {
            "law": "wave",
            "delay_s": delay / RATE_HZ,
            "pairs": dict.fromkeys(pairs, reported),
        },
        "simulation": {
            "environment": {
                pair: {"type": "wall", "stiffness": 1500.0, "position": 0.08, "side": "above"}
                for pair in pairs
            }
        },
        **top,
    }


def summarize(columns: Columns, pairs: tuple[str, ...], delay: int, **top: Any) -> dict[str, Any]:
    """A summary with the keys that a run writes, from the columns."""
    rows = len(columns["time_s"])
    reported: dict[str, Any] = {
        "rig": "bench-1dof",
        "version": "0.1.0",
        "outcome": {"kind": "finished", "sentence": "Ran for the 10 s asked for."},
        "started_utc": "2026-03-02T14:05:11Z",
        "command": "tautwave run configs/bench-1dof-loopback.yaml --duration 10",
        "clock": "real",
        "cycles": rows,
        "missed_cycles": int(columns["skipped_slots"].sum()),
        "rate_hz": RATE_HZ,
        "duration_s": rows / RATE_HZ,
        "wall_time_s": rows / RATE_HZ + 0.213,
        "period_us": _spread(1e6 * np.diff(columns["time_s"])),
        "compute_us": _spread(columns["compute_us"]),
        "lateness_us": _spread(columns["lateness_us"]),
        "recording": {"rows_written": rows, "rows_dropped": 0, "error": None},
        "realtime": [
            "SCHED_FIFO priority 50 was not permitted (needs CAP_SYS_NICE); ran as an ordinary "
            "process.",
            "Memory was locked.",
        ],
        "pairs": {},
        "energy_j": {
            "gross_flow": 4.318,
            "residual": 3.1e-15,
            "generated": 2.7e-4,
            "sensing_gap": 1.3e-3,
            "plant_residual": 4.4e-14,
        },
        "axes": {},
        "certificate": {"passed": None, "verdicts": []},
        "left_out": [],
    }
    for pair in pairs:
        error, effort = columns[f"{pair}.position_error"], columns[f"{pair}.effort_error"]
        port = columns[f"slave.{pair}.port_effort"]
        reported["pairs"][pair] = {
            "kind": "linear",
            "coupling_delay_s": delay / RATE_HZ,
            "expected_offset": float(np.abs(port).max()) * delay / RATE_HZ / 6.0,
            "position_error": _size(error),
            "effort_error": _size(effort),
            "elements": {
                element: {
                    "absorbed": float(columns[f"{pair}.{element}.absorbed"][-1]),
                    "stored": float(columns[f"{pair}.{element}.stored"][-1]),
                    "dissipated": float(columns[f"{pair}.{element}.dissipated"][-1]),
                    "generated": max(0.0, -float(columns[f"{pair}.{element}.absorbed"].min())),
                }
                for element in ELEMENTS
            },
        }
        for side in ("master", "slave"):
            valid = columns[f"{side}.{pair}.valid"]
            reported["axes"][f"{side}.{pair}"] = {
                "lost": int((valid == 0).sum()),
                "late": 2,
                "faults": ["following error, cleared"] if side == "slave" else [],
            }
        reported["left_out"] += [
            f"wall_master of {pair}: not in the rig",
            f"wave filter of {pair}: wave_filter_hz is not given",
        ]
    return {**reported, **top}


def _spread(values: NDArray[np.float64]) -> dict[str, float]:
    at = {"p50": 50.0, "p99": 99.0, "p999": 99.9}
    reported = {name: float(np.percentile(values, q)) for name, q in at.items()}
    return {**reported, "max": float(values.max())}


def _size(values: NDArray[np.float64]) -> dict[str, float]:
    return {"rms": float(np.sqrt(np.mean(values**2))), "max": float(np.abs(values).max())}


def make_columns(
    pairs: tuple[str, ...] = ("wrist",), rows: int = 10_000, delay: int = 20
) -> Columns:
    """All columns of a run with these pairs."""
    columns = timing(rows)
    for seed, pair in enumerate(pairs):
        columns.update(simulate_pair(pair, rows, delay, seed=seed))
    return columns


class _Plain(yaml.SafeDumper):
    """Writes what is used twice out twice: rig files have no anchors."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def make_run(
    directory: Path,
    pairs: tuple[str, ...] = ("wrist",),
    rows: int = 10_000,
    delay: int = 20,
    columns: Columns | None = None,
    rig_top: dict[str, Any] | None = None,
    **summary_top: Any,
) -> dict[str, Any]:
    """Write a whole run directory and return its summary."""
    directory.mkdir(parents=True, exist_ok=True)
    if columns is None:
        columns = make_columns(pairs, rows, delay)
    reported = summarize(columns, pairs, delay, **summary_top)
    text = yaml.dump(rig(pairs, delay, **(rig_top or {})), Dumper=_Plain, sort_keys=False)
    (directory / "rig.yaml").write_text(text, encoding="utf-8")
    (directory / "summary.json").write_text(json.dumps(reported, indent=1), encoding="utf-8")
    write_recording(directory / "recording.mcap", columns, text)
    return reported


def write_recording(path: Path, columns: Columns, rig_text: str = "", finish: bool = True) -> None:
    """Columns as a recording, without the process that writes them in a run."""
    names = list(columns)
    metadata = {"version": "0.1.0", "rate_hz": str(RATE_HZ)}
    attachments = {"rig.yaml": rig_text.encode()} if rig_text else {}
    file = McapFile(str(path), names, metadata, attachments, 1_772_460_311_000_000_000)
    rows = np.column_stack([*columns.values(), np.arange(1.0, len(columns["time_s"]) + 1)])
    for at in range(0, len(rows), file.rows_per_chunk):
        file.append(rows[at : at + file.rows_per_chunk])
    if finish:
        file.finish({"rows_written": str(len(rows)), "ended_by": "loop"})
    file.close()
