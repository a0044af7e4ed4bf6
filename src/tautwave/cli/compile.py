"""`tautwave compile`: fill the cache of compiled simulations ahead of time."""

from __future__ import annotations

import time
from pathlib import Path

import click

from tautwave.cli.options import echo_json, json_option


@click.command("compile", short_help="Compile the simulation of a rig's law ahead of time.")
@click.argument("rigs", nargs=-1, type=click.Path(path_type=Path))
@json_option
def compile_(rigs: tuple[Path, ...], as_json: bool) -> None:
    """Compile what `sweep`, `simulate` and long reports run for each of RIGS.

    A law is compiled once per machine, version and Python, which takes about half a minute on one
    core; afterwards it is read from the cache (NUMBA_CACHE_DIR, or the user's cache directory).
    Default: the README's rig.

    \b
    Examples:
        tautwave compile
        tautwave compile my-rig.yaml scene.yaml
    """
    from tautwave.config import load_rig
    from tautwave.config.shipped import find_example
    from tautwave.simulation import simulate
    from tautwave.simulation.run import is_compiled

    done = []
    for path in rigs or (find_example("bench-1dof-loopback").path,):
        rig = load_rig(path)
        before = is_compiled(rig)
        what = f"law {rig.coupling.law}" if rig.scene is None else "scenes"
        if not (before or as_json):
            click.echo(f"{rig.name}: compiling {what}, about half a minute", err=True)
        start = time.perf_counter()
        simulate(rig, duration_s=2.0 * rig.period_s)
        seconds = time.perf_counter() - start
        done.append({"rig": rig.name, "compiled": not before, "seconds": seconds})
        if not as_json:
            state = "in the cache already" if before else f"compiled in {seconds:.0f} s"
            click.echo(f"{rig.name}: {what}: {state}")
    if as_json:
        echo_json(done)
