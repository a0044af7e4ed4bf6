"""The entry point of scenes."""

from __future__ import annotations

from tautwave.contracts import ControlPlugin

plugin = ControlPlugin(
    summary="networks of masses and links, and tissue, that the master's axes touch",
    config="tautwave_scenes.config.hooks",
    rig="tautwave_scenes.rig.hooks",
    certificate="tautwave_scenes.certificate.hooks",
    simulation="tautwave_scenes.simulation.hooks",
    session="tautwave_scenes.session.hooks",
    report="tautwave_scenes.report.hooks",
    bench="tautwave_scenes.bench.hooks",
)
