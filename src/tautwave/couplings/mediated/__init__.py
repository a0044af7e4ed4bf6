"""Law mediated: the slave follows, estimates what it touches, and the master renders that model.

For long delays. Nothing is fed back but what changes of the model, so that no loop is closed over
the line; that what the master renders was taken before is the account's (`coupling.account`).

`estimate` is what the slave learns of a contact; `law` filters its signals, renders what was
learned, and has the steps of either end.
"""

from __future__ import annotations

from tautwave.contracts import CouplingPlugin

_ROOM = "tautwave.couplings.mediated"

plugin = CouplingPlugin(
    summary="model-mediated: the slave estimates what it touches, the master renders it",
    keys=f"{_ROOM}.keys:MediatedCoupling",
    law=f"{_ROOM}.law:law",
    over_link="tautwave.couplings.over_link:linked_law",
    linked="tautwave.couplings.over_link:linked",
    end_constants=f"{_ROOM}.law:end_constants",
    verdict=f"{_ROOM}.certificate:verdict",
    messages=f"{_ROOM}.certificate:messages",
    resolve=f"{_ROOM}.keys:resolve",
    missing=f"{_ROOM}.keys:missing",
)
