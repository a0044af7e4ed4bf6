"""Certificates that say what is guaranteed, and nothing of what would be better."""

from __future__ import annotations

import pytest

from tautwave.couplings.wave import certificate as verdict
from tautwave.couplings.wave.device_port import DevicePort


@pytest.fixture
def without_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out remedies and the stiffest contact: most of a certificate's time goes into them."""
    for name in ("binding", "remedy_of"):
        monkeypatch.setattr(verdict, name, lambda *_: "")
    monkeypatch.setattr(DevicePort, "stiffest", lambda _: 0.0)
