"""What is guaranteed of a rig, by which theorem, with which margin: `certify(rig)`.

Needs NumPy and nothing heavier. A live run computes it in a process of its own
(`python -m tautwave.certificate`), so that the loop's process stays light.
"""

from tautwave.certificate.data import Certificate, Element, LoopCase, PairLoop, Verdict
from tautwave.certificate.verdict import certify

__all__ = ["Certificate", "Element", "LoopCase", "PairLoop", "Verdict", "certify"]
