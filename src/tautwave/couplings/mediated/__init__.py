"""Law mediated: the slave follows, estimates what it touches, and the master renders that model.

For long delays. Nothing is fed back but what changes of the model, so that no loop is closed over
the line; that what the master renders was taken before is the account's (`coupling.account`).

`signals` filters, `fit` estimates, `contact` decides what counts, `model` renders; `steps` calls
them at either end.
"""

from __future__ import annotations

from tautwave.contracts import CouplingPlugin
from tautwave.couplings.over_link import LINKED, LINKED_LAW

_ROOM = "tautwave.couplings.mediated"

plugin = CouplingPlugin(
    summary="model-mediated: the slave estimates what it touches, the master renders it",
    keys=f"{_ROOM}.keys:MediatedCoupling",
    law=f"{_ROOM}.steps:law",
    over_link=LINKED_LAW,
    linked=LINKED,
    end_constants=f"{_ROOM}.from_keys:end_constants",
    verdict=f"{_ROOM}.certificate:verdict",
    messages=f"{_ROOM}.certificate:messages",
    resolve=f"{_ROOM}.keys:resolve",
    missing=f"{_ROOM}.keys:missing",
)
