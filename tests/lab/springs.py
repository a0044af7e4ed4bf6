"""`python -m tests.lab springs`: rigs with a spring at the edge of their certificates, attacked."""

from __future__ import annotations

import multiprocessing
import statistics
from collections.abc import Iterator
from typing import NamedTuple

import click

from tautwave.certificate import certify
from tests.certificate.springs import ROUNDING, attack, drawn, edge_of


class Tried(NamedTuple):
    """One drawn rig: whether it is certified, how, and the most that anybody gained."""

    seed: int
    certified: bool
    gentle: bool
    motions: int
    share: float
    ratio: float


def tried(seed: int) -> Tried:
    """Draw a rig, take away what damping it can spare, and attack it."""
    found = edge_of(drawn(seed))
    if found is None:
        return Tried(seed, False, False, 0, -1.0, 0.0)
    [coupling] = [one for one in certify(found.rig).elements if one.kind == "coupling"]
    numbers = coupling.numbers
    got = attack(found, seed)
    ratio = numbers["clipped_needed"] / numbers["needed"] if numbers["needed"] > 0.0 else 1.0
    return Tried(seed, True, found.gentle, got.motions, got.share, ratio)


def many(seeds: range, jobs: int) -> Iterator[Tried]:
    """Yield what became of rigs, in any order."""
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        yield from pool.imap_unordered(tried, seeds, chunksize=4)


@click.command
@click.option("--rigs", default=10_000, show_default=True, help="How many rigs are drawn.")
@click.option("--first", default=0, show_default=True, help="Seed of the first one.")
@click.option("--jobs", default=1, show_default=True, help="Processes.")
def springs(rigs: int, first: int, jobs: int) -> None:
    """Attack certified springs at the edge of their certificates: nobody may gain."""
    found: list[Tried] = []
    for one in many(range(first, first + rigs), jobs):
        found.append(one)
        if one.certified and one.share > ROUNDING:
            click.echo(f"seed {one.seed}: gains {one.share:.3g} of the gross flow")
        if len(found) % 500 == 0:
            click.echo(_summary(found))
    click.echo(_summary(found))
    if any(one.certified and one.share > ROUNDING for one in found):
        raise SystemExit(1)


def _summary(found: list[Tried]) -> str:
    held = [one for one in found if one.certified]
    if not held:
        return f"{len(found)} rigs, none certified"
    ratios = [one.ratio for one in held]
    return (
        f"{len(found)} rigs, {len(held)} certified ({sum(one.gentle for one in held)} as long as "
        f"not clipped), {sum(one.motions for one in held)} motions, "
        f"{sum(one.share > ROUNDING for one in held)} gain, at most "
        f"{max(one.share for one in held):.2g} of the gross flow; clipped over linear need: median "
        f"{statistics.median(ratios):.3f}, at most {max(ratios):.2f}"
    )
