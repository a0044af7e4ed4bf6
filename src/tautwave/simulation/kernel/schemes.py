"""A job with its devices moved another way: by a named integrator, or along recorded positions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tautwave.models.foam import FoamParams
from tautwave.models.integrators.schemes import EXACT
from tautwave.simulation.kernel.pack import NO_FOAM, Array, Job
from tautwave.simulation.kernel.records import FOAM, HELD, PLANT, SERVO, DeviceParams


def contact_of(device: DeviceParams) -> FoamParams:
    """Return what a device meets as a contact law, whichever physics moves it."""
    if device.kind == FOAM:
        return device.foam
    p = device.plant
    return FoamParams(p.wall_stiffness, 1.0, 0.0, p.wall_position, p.wall_side, 1, p.wall_damping)


def with_scheme(job: Job, scheme: int, substeps: int, tolerance: float) -> Job:
    """Return a job whose impedance devices are moved by one scheme of `models.integrators`.

    Foam has no `exact` step and keeps its own; drives with a velocity loop are exact as they are.
    """
    devices = []
    for device in job.devices:
        if device.kind == SERVO or (scheme == EXACT and device.kind == FOAM):
            devices.append(device)
        elif scheme == EXACT:
            devices.append(device._replace(kind=PLANT, foam=NO_FOAM))
        else:
            foam = contact_of(device)._replace(
                scheme=scheme, substeps=substeps, tolerance=tolerance
            )
            devices.append(device._replace(kind=FOAM, foam=foam))
    return job._replace(devices=tuple(devices))


def with_positions(job: Job, positions: Mapping[str, Array]) -> Job:
    """Return a job whose devices are where they were recorded, whatever their motors do.

    Parameters
    ----------
    positions : mapping
        By axis, positions [rad or m] at the slots of the axis' own bus; the last one is held.
    """
    pieces = [np.asarray(job.table)]
    at = len(job.table)
    devices = []
    starts = []
    columns: list[str] = []
    for column in job.columns:
        columns.append(column)
        axis = column.removeprefix("true.").removesuffix(".velocity")
        if column == f"true.{axis}.velocity" and f"true.{axis}.reference" not in job.columns:
            # A device with a reference fills these two as well.
            columns += [f"true.{axis}.reference", f"true.{axis}.hand_effort"]
    for name, device in zip(job.axes, job.devices, strict=True):
        given = np.asarray(positions[name], dtype=np.float64)
        devices.append(
            device._replace(
                kind=HELD,
                reference=at,
                last=len(given) - 1,
                encoder_quantum=0.0,
                position_noise=0.0,
                loses=False,
            )
        )
        pieces.append(given)
        starts.append(float(given[0]))
        at += len(given)
    return job._replace(
        columns=tuple(columns),
        devices=tuple(devices),
        start=tuple(starts),
        table=np.concatenate(pieces),
    )
