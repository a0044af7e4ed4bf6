"""Law wave: a transmission line between two wave ports, passive at any constant delay.

Bus dividers are allowed (rate converters), and axes that take velocity.
"""

from tautwave.contracts import CouplingPlugin

plugin = CouplingPlugin(
    summary="transmission line between wave ports, passive at any constant delay",
    keys="tautwave.couplings.wave.keys:WaveCoupling",
    law="tautwave.couplings.wave.steps:law",
    end_constants="tautwave.couplings.wave.from_keys:end_constants",
    link_constants="tautwave.couplings.wave.from_keys:link_constants",
    carries="waves",
    divisors=True,
    causalities=("impedance", "admittance"),
    linear="tautwave.couplings.wave.linear:linear_end",
    verdict="tautwave.couplings.wave.verdict:verdict",
    messages="tautwave.couplings.wave.messages:messages",
)
