"""The entry point of scenes."""

from __future__ import annotations

from tautwave.contracts import ControlPlugin

plugin = ControlPlugin(
    summary="networks of masses and links, and tissue, that the master's axes touch",
    config="tautwave.config.scene_hooks",
    rig="tautwave.rig.scene.hooks",
    certificate="tautwave.certificate.scene.hooks",
    simulation="tautwave.simulation.scene.hooks",
    session="tautwave.session.scene_hooks",
    report="tautwave.report.scene.hooks",
    bench="tautwave.bench.precision.scene_hooks",
)
