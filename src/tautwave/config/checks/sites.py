"""Cross-checks of a rig for two machines."""

from __future__ import annotations

from tautwave.config.halves import OF_ONE_END, SIDES, buses_of
from tautwave.config.keys.sites import Sites
from tautwave.config.messages import salvage
from tautwave.config.pieces import Parts
from tautwave.config.text.document import Document
from tautwave.contracts import CouplingPlugin


def check_sites(document: Document, parts: Parts, law: CouplingPlugin | None) -> None:
    """Note what two machines cannot share, or would not agree on."""
    sites: Sites | None = salvage(Sites, document.get(("sites",)))
    if sites is None:
        return
    if set(document.get(("sites",))) == {"here"}:
        document.report(
            ("sites", "here"),
            "the rig file has no sites block; add one with the serving site and its address",
        )
        return
    if document.get(("scene",)) is not None:
        document.report(("sites",), "a scene has one site only; remove it")
        return
    if getattr(sites, sites.serves).address is None:
        document.report(
            ("sites", sites.serves),
            f"address: required key is missing: {sites.serves} serves, and "
            "the other site connects to it",
        )
    shared = buses_of(document, "master") & buses_of(document, "slave")
    for bus in sorted(shared):
        document.report(
            ("buses", bus),
            "has axes of both sides, but two machines cannot share a bus; use two buses",
        )
    coupling = parts.coupling
    if coupling is None:
        return
    kept = coupling.account is not None and law is not None and law.over_link
    if law is not None and not law.at_sites and not kept:
        document.report(
            ("sites",),
            f"law {coupling.law} without an account runs in one process only; add "
            "coupling.account, or use law wave",
        )
    for name, pair in (parts.pairs or {}).items():
        for key, value in pair or ():
            if value == "auto" and not key.endswith(OF_ONE_END):
                document.report(
                    ("coupling", "pairs", name),
                    f"{key}: with two sites, auto is not possible because it depends "
                    "on both devices; give a value",
                )
    if document.get(("loop", "engine")) == "compiled" and document.get(("sites", "here")) in SIDES:
        document.report(("loop", "engine"), "a site runs in Python only; remove it")
    if document.get(("require",)) == "coupled_stable":
        document.report(
            ("require",),
            "with two sites, the other device and the network are unknown; use passive",
        )
