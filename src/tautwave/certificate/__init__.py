"""What is guaranteed for a rig, by which theorem, with which margin: `certify(rig)`.

Needs NumPy and nothing heavier. A live run computes it in a separate process (`python -m
tautwave.certificate`), so that the loop's process stays light.
"""

from tautwave.certificate.data import Certificate, Element, LoopCase, PairLoop, Verdict
from tautwave.certificate.verdict import certify

__all__ = ["Certificate", "Element", "LoopCase", "PairLoop", "Verdict", "certify"]
