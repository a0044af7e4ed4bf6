"""What a hand feels under every law, by delay, as a table: `python -m tests.certificate.feels`."""

from __future__ import annotations

from tautwave.certificate.haptics.feel import rig_feel
from tautwave.config import load_rig
from tests.rigs.holds import BENCH, LAWS

DELAYS_MS = 0.0, 5.0, 20.0, 100.0


def row(law: str) -> str:
    """Return a line of the table: felt stiffness [N m/rad], drag [N m] by delay."""
    name, keys, account = LAWS[law]
    books = "account: {}, " if account else ""
    cells = []
    for delay in DELAYS_MS:
        block = f"law: {name}, delay_s: {1e-3 * delay}, {books}pairs: {{lever: {{{keys}}}}}"
        one = rig_feel(load_rig(BENCH, [f"coupling={{{block}}}"]))[0][0]
        felt = "-" if one.stiffness is None else f"{one.stiffness:.3g}"
        drag = "-" if one.drag is None else f"{one.drag:.3f}"
        cells.append(f"{felt} / {drag}")
    return f"| {law} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    print("| law | " + " | ".join(f"{delay:g} ms" for delay in DELAYS_MS) + " |")
    print("|---" * (len(DELAYS_MS) + 1) + "|")
    for law in LAWS:
        print(row(law), flush=True)
