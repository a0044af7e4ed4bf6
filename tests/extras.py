"""What each extra adds to an installation: `python -m tests.extras`, where all are installed.

Of each, the distributions that it needs beyond tautwave's own, by their metadata, and the size of
their files as their RECORD has it (without what Python compiles).
"""

from __future__ import annotations

from importlib.metadata import Distribution, PackageNotFoundError, distribution

from packaging.requirements import Requirement

LEFT_OUT = ("test", "peers", "docs", "dev", "all", "bench")


def needed(name: str, extra: str = "", known: dict[str, Distribution] | None = None) -> set[str]:
    """Return the names of what a distribution needs, itself and all below it."""
    known = {} if known is None else known
    try:
        found = distribution(name)
    except PackageNotFoundError:
        return {f"{name} (not installed)"}
    names = {found.metadata["Name"]}
    for text in found.requires or ():
        one = Requirement(text)
        if one.marker is not None and not one.marker.evaluate({"extra": extra}):
            continue
        for wanted in one.extras or {""}:
            key = f"{one.name}[{wanted}]"
            if key not in known:
                known[key] = found
                names |= needed(one.name, wanted, known)
    return names


def size_mb(name: str) -> float:
    """Return the size of a distribution's files [MB]; 0 of one that is not installed."""
    if name.endswith("(not installed)"):
        return 0.0
    return sum(file.size or 0 for file in distribution(name).files or ()) / 1e6


def main() -> None:
    """Print a table of all extras."""
    own = needed("tautwave")
    listed = distribution("tautwave").metadata.get_all("Provides-Extra") or []
    print("| extra | adds | MB |\n| --- | --- | --- |")
    print(f"| - | {len(own) - 1} packages | {sum(map(size_mb, own)):.0f} |")
    for extra in sorted(set(listed) - set(LEFT_OUT)):
        added = sorted(needed("tautwave", extra) - own, key=str.lower)
        print(f"| `{extra}` | {', '.join(added)} | {sum(map(size_mb, added)):.1f} |")


if __name__ == "__main__":
    main()
