"""A term of the wave law that no verdict knows of would go unseen: each constant is accounted for.

Who adds one to the law says here where the certificate reads it, or why it need not.
"""

from __future__ import annotations

from tautwave.couplings.wave.port import WaveEndParams

GUARD = "decides only when a run stops"
WAVE = {
    "port": "the certificate's loops and claims are of the same port (`from_keys.bare_port`)",
    "observer": "the same loops and the leak (`from_keys.observer_of`)",
    "admittance": "the loops of axes that take velocity",
    "wave": "a change of units: device wave per line wave",
    "quantum": "decides only what counts as cut",
    "step": "what it gives back is in the leak (`from_keys.effort_steps`)",
    "late": "the delay of the port in loops and claims",
    "delay": "the delay of the port in loops and claims",
    **dict.fromkeys(
        ("window", "port_starved", "empty", "position_debt", "patience", "coarse", "noisy"), GUARD
    ),
}


def unaccounted(fields: tuple[str, ...]) -> set[str]:
    """Return constants of an end of which nothing is said here, and what is said of none."""
    return set(fields) ^ set(WAVE)


def test_a_verdict_accounts_for_every_constant_of_a_wave_end() -> None:
    assert not unaccounted(WaveEndParams._fields)


def test_a_planted_damper_is_noticed() -> None:
    assert unaccounted((*WaveEndParams._fields, "foo")) == {"foo"}
