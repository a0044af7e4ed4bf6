"""Law observed_wave: a wave line whose ports hold a force under noise and claim joules they keep.

An observer in place of the velocity filter, the wave filter inside the port, and a tank with a
reserve; see `tautwave.laws.port`.
"""

from tautwave.contracts import CouplingPlugin

plugin = CouplingPlugin(
    summary="transmission line between observed ports: holds under noise, claims its joules",
    keys="tautwave.couplings.wave.keys:WaveCoupling",
    law="tautwave.couplings.wave.steps:law",
    end_constants="tautwave.couplings.wave.from_keys:end_constants",
    carries="waves",
    divisors=True,
    causalities=("impedance",),
    linear="tautwave.couplings.wave.linear:linear_end",
    verdict="tautwave.couplings.wave.verdict:verdict",
    claim="tautwave.couplings.wave.claim:claimed_joules",
    resolve="tautwave.couplings.wave.automatic:resolve",
    messages="tautwave.couplings.wave.messages:messages",
)
