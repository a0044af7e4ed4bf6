"""Law wave: a transmission line between two ports, passive at any constant delay.

Its ports hold a force under noise and claim joules that they keep, see `tautwave.laws.port`. Bus
dividers are allowed (rate converters), and axes that take velocity.
"""

from tautwave.contracts import CouplingPlugin

plugin = CouplingPlugin(
    summary="transmission line between ports with energy claims, passive at any constant delay",
    keys="tautwave.couplings.wave.keys:WaveCoupling",
    law="tautwave.couplings.wave.law:law",
    over_link="tautwave.couplings.wave.link:law",
    at_sites="tautwave.couplings.wave.link:site_laws",
    linked="tautwave.couplings.wave.link:linked",
    end_constants="tautwave.couplings.wave.from_keys:end_constants",
    carries="waves",
    divisors=True,
    causalities=("impedance", "admittance"),
    observes=True,
    linear="tautwave.couplings.wave.claim:linear_end",
    verdict="tautwave.couplings.wave.certificate:verdict",
    claim="tautwave.couplings.wave.claim:claimed_joules",
    claim_terms="tautwave.couplings.wave.claim:claim_of",
    variant="tautwave.couplings.wave.augmented:with_augmentation",
    resolve="tautwave.couplings.wave.automatic:resolve",
    tune="tautwave.couplings.wave.port:tune",
    messages="tautwave.couplings.wave.messages:messages",
)
