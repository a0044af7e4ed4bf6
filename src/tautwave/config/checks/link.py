"""Cross-checks between a rig's `link` and its other keys."""

from __future__ import annotations

from tautwave.config.inputs.recordings import require_file
from tautwave.config.keys.common import AUTO
from tautwave.config.keys.link import DRAWN, Link
from tautwave.config.pieces import Parts
from tautwave.config.text.document import Document
from tautwave.contracts import CouplingPlugin


def check_link(document: Document, parts: Parts, law: CouplingPlugin | None) -> None:
    """Note a network that nothing can use, and keys that exclude each other."""
    if document.get(("link",)) is None:
        return
    if document.get(("scene",)) is not None:
        document.report(
            ("link",), "connects two sides, and a rig with a scene has only one; remove it"
        )
        return
    if law is not None and not law.over_link and parts.coupling is not None:
        document.report(
            ("link",), f"law {parts.coupling.law} does not work over a network; use another law"
        )
    if parts.coupling is not None and parts.coupling.delay_s > 0.0:
        document.report(
            ("coupling", "delay_s"),
            f"a link has its own delay ({document.where(('link',))}): remove this one, or the link",
        )
    if parts.link is not None:
        _check_keys(document, parts.link)


def _check_keys(document: Document, link: Link) -> None:
    if link.trace is not None:
        for key in DRAWN:
            if getattr(link, key) != Link.model_fields[key].default:  # the kept rig names them all
                document.report(
                    ("link", key), "cannot be combined with a trace; remove one of them"
                )
        require_file(document, ("link", "trace"), link.trace)
    if 0.0 < link.outage_every_s <= link.outage_s:
        document.report(
            ("link", "outage_every_s"),
            f"an outage would begin before the last one ended; give more than outage_s, "
            f"{link.outage_s:g} s (got {link.outage_every_s:g})",
        )
    deepest = link.deepest_s if link.depth_s == AUTO else float(link.depth_s)
    if link.play_out == "fixed" and link.silence_s < deepest:
        document.report(
            ("link", "silence_s"),
            "a side would hold while waves are still to be played out; give "
            f"the depth, {deepest:g} s, or "
            f"more (got {link.silence_s:g})",
        )
    if link.lost_s <= link.delay_s + link.silence_s:
        document.report(
            ("link", "lost_s"),
            f"should be more than delay_s and silence_s together, "
            f"{link.delay_s + link.silence_s:g} s (got {link.lost_s:g})",
        )
