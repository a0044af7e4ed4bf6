"""Law wave: a transmission line between two wave ports, passive at any constant delay.

Bus dividers are allowed (rate converters), and axes that take velocity.
"""

from tautwave.contracts import CouplingPlugin

plugin = CouplingPlugin(
    summary="transmission line between wave ports, passive at any constant delay",
    keys="tautwave.couplings.tracked.keys:WaveCoupling",
    law="tautwave.couplings.tracked.steps:law",
    end_constants="tautwave.couplings.tracked.from_keys:end_constants",
    link_constants="tautwave.couplings.tracked.from_keys:link_constants",
    carries="waves",
    divisors=True,
    causalities=("impedance", "admittance"),
    linear="tautwave.couplings.tracked.linear:linear_end",
    verdict="tautwave.couplings.tracked.verdict:verdict",
    messages="tautwave.couplings.tracked.messages:messages",
)
