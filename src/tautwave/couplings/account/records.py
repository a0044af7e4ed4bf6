"""State of an account at each end of a pair and between them, beside that of the law in it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class AccountEnd:
    """One end's tank and books [J, own units].

    `funds` in the tank, `reserve` of them from the start, 0 before; `far_level` of the other end as
    reported, a share of full; `sent` all credit ever sent, `counter` the far one's as last received
    [J, pair's]; `taken` what came of it; `work` what the law took from the device; `spilled` from a
    full tank, `granted` for noise; `smooth` the device's velocity, smoothed [rad/s or m/s]. In this
    second so far `watched` efforts, their sizes as `asked` for and as they were `let` through [N m
    or N], and the seconds before it in which the end `lost` its hold; `held`, the mean of the best
    second. `pull` and `cut` are sums with their signs of what was asked for and what of it was cut,
    `apart` the seconds before in which the pair stood apart for it, `least_cut` the least of them.
    """

    funds: float = 0.0
    reserve: float = 0.0
    far_level: float = 0.0
    sent: float = 0.0
    counter: float = 0.0
    taken: float = 0.0
    work: float = 0.0
    spilled: float = 0.0
    granted: float = 0.0
    smooth: float = 0.0
    asked: float = 0.0
    let: float = 0.0
    watched: int = 0
    lost: int = 0
    held: float = 0.0
    pull: float = 0.0
    cut: float = 0.0
    apart: int = 0
    least_cut: float = 0.0


@dataclass(slots=True)
class AccountLink:
    """Where the line of credits stands."""

    at: int = 0
