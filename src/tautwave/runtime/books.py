"""Columns of the recording that a pair owns, and how they are filled once a cycle.

Every element of the coupling has three: energy absorbed so far, energy stored now, energy
dissipated so far (negative: generated), all in pair units [J]. Each is kept by the element from
its own inputs. `port_energy` of an axis is what its motor took out of the device (effort sent
times displacement measured): the sum over axes has to be the sum over elements.
"""

from __future__ import annotations

from tautwave.contracts import Row
from tautwave.runtime.pair import Pair, PositionPair, WavePair
from tautwave.runtime.rates import MultiratePair, RateConverter
from tautwave.runtime.site import SiteAxis


def axis_columns(name: str, site: SiteAxis) -> list[str]:
    """Return the column names of one axis, e.g. `master.wrist`."""
    names = ["position", "velocity", "commanded", "port_effort", "valid"]
    names += ["port_energy", "gross_flow", "uncertainty"]
    if site.by_wave:
        names += ["wave_in", "wave_out"]
    if not site.impedance:
        names += ["measured_effort"]
    if site.has_wall:
        names += ["wall_effort"]
    return [f"{name}.{column}" for column in names]


def fill_axis(site: SiteAxis, weight: float, row: Row, at: int) -> int:
    """Write the columns of one axis at index `at`; return the next index."""
    row[at] = site.position
    row[at + 1] = site.velocity
    row[at + 2] = site.command
    row[at + 3] = site.port_effort
    row[at + 4] = 1.0 if site.valid else 0.0
    row[at + 5] = weight * site.port_energy
    row[at + 6] = weight * site.gross_flow
    row[at + 7] = weight * site.uncertainty
    at += 8
    if site.by_wave:
        row[at] = site.arrived
        row[at + 1] = site.leaving
        at += 2
    if not site.impedance:
        row[at] = site.outside
        at += 1
    if site.has_wall:
        row[at] = site.wall_effort
        at += 1
    return at


def fill_element(row: Row, at: int, absorbed: float, stored: float, dissipated: float) -> int:
    """Write one element's account; return the next index."""
    row[at] = absorbed
    row[at + 1] = stored
    row[at + 2] = dissipated
    return at + 3


class PairRow:
    """The columns of one pair and its two axes."""

    def __init__(self, pair: Pair) -> None:
        self._pair = pair
        self._sides = ((pair.master, 1.0), (pair.slave, pair.weight))
        name = pair.name
        self.elements = elements_of(pair)
        self.columns = [
            *axis_columns(f"master.{name}", pair.master),
            *axis_columns(f"slave.{name}", pair.slave),
            f"{name}.position_error",
            f"{name}.effort_error",
        ]
        for element in self.elements:
            self.columns += [
                f"{name}.{element}.{part}" for part in ("absorbed", "stored", "dissipated")
            ]

    def fill(self, row: Row, at: int) -> None:
        """Write all columns of the pair at index `at`."""
        pair = self._pair
        for site, share in self._sides:
            at = fill_axis(site, share, row, at)
        row[at] = pair.position_error()
        row[at + 1] = pair.effort_error()
        at += 2
        if isinstance(pair, WavePair):
            at = self._fill_waves(pair, row, at)
        elif isinstance(pair, PositionPair):
            at = fill_element(
                row,
                at,
                pair.absorbed,
                pair.stored - pair.start_stored,
                pair.dissipated,
            )
        for site, share in self._sides:
            if site.has_wall:
                at = fill_element(
                    row,
                    at,
                    share * site.wall_absorbed,
                    share * (site.wall_stored() - site.wall_stored_at_start),
                    share * site.wall_dissipated,
                )

    def _fill_waves(self, pair: WavePair, row: Row, at: int) -> int:
        """Write ports, series dampers, converters, filters and line."""
        for site, share in self._sides:
            waiting = site.waiting_energy()
            at = fill_element(
                row,
                at,
                share * (site.port_absorbed + waiting),
                share * (site.account + waiting),
                -share * site.forgiven,
            )
            if site.has_damper:
                at = fill_element(row, at, share * site.burnt, 0.0, share * site.burnt)
        for _, converter in converters_of(pair):
            at = fill_element(row, at, converter.absorbed, converter.stored, converter.dissipated)
        if pair.filters is not None:
            for wave_filter in pair.filters:
                at = fill_element(
                    row, at, wave_filter.absorbed, wave_filter.stored, wave_filter.dissipated
                )
        if pair.line is not None:
            at = fill_element(row, at, pair.line.absorbed, pair.line.stored, 0.0)
        return at


def elements_of(pair: Pair) -> list[str]:
    """Return the names of the pair's elements in the order of their columns."""
    names: list[str] = []
    if isinstance(pair, WavePair):
        for side, site in (("master", pair.master), ("slave", pair.slave)):
            names.append(f"port_{side}")
            if site.has_damper:
                names.append(f"damper_{side}")
        names += [f"converter_{side}" for side, _ in converters_of(pair)]
        if pair.filters is not None:
            names += ["filter_master", "filter_slave"]
        if pair.line is not None:
            names.append("line")
    else:
        names.append("coupler")
    for side, site in (("master", pair.master), ("slave", pair.slave)):
        if site.has_wall:
            names.append(f"wall_{side}")
    return names


def converters_of(pair: WavePair) -> list[tuple[str, RateConverter]]:
    """Return the rate converters of a pair, each with its side; none at the line's own rate."""
    if not isinstance(pair, MultiratePair):
        return []
    sides = zip(("master", "slave"), pair.converters, strict=True)
    return [(side, converter) for side, converter in sides if converter is not None]
