"""Older rig files, rewritten: what changed is as it is now, everything else stays to the letter."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave import formats
from tautwave.config import load_rig
from tautwave.config.rewriting import rewrite_older
from tautwave.config.text.yaml12 import parse_yaml
from tautwave.errors import ConfigError

CONFIGS = Path(__file__).parents[2] / "configs"
BENCH = (CONFIGS / "bench-1dof-loopback.yaml").read_text()
NOW = "      wave_filter_hz: 100          # else encoder steps ring in the lossless line\n"
FOR_ALL = "  wave_filter_hz: 100  # else encoder steps ring\n  pairs:\n"
LATER = BENCH.replace(NOW, "").replace("  pairs:\n", FOR_ALL)
OLDER = LATER.replace("  law: wave\n", "  law: observed_wave  # the new port\n")
DRIFTS = OLDER.replace("wave_impedance: 0.02\n", "wave_impedance: 0.02\n      drift_time_s: 2\n")
PLAIN = parse_yaml(BENCH).value


@pytest.mark.parametrize("text", [OLDER, DRIFTS, f"format: 1\n{DRIFTS}"])
def test_an_older_rig_is_the_same_rig_and_keeps_its_comments(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError):
        _load(tmp_path, text)
    found = rewrite_older(text, "bench.yaml")
    value = parse_yaml(found.text).value
    assert value.pop("format", formats.RIG) == formats.RIG
    assert value == PLAIN
    assert _load(tmp_path, found.text) == _load(tmp_path, BENCH)
    comments = [line.partition("#")[2] for line in text.splitlines() if "#" in line]
    assert [line.partition("#")[2] for line in found.text.splitlines() if "#" in line] == comments
    assert len(found.changes) == 3 + ("drift" in text) + ("format" in text[:7])


def _load(folder: Path, text: str) -> object:
    (folder / "bench.yaml").write_text(text)
    return load_rig(folder / "bench.yaml")


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_a_shipped_rig_is_left_as_it_is(path: Path) -> None:
    text = path.read_text()
    assert rewrite_older(text, path.name) == (text, ())


SPACE = st.sampled_from(["", " ", "  "])
NUMBER = st.sampled_from(["100", "1e2", "62.5"])


@settings(max_examples=20)
@given(st.lists(st.sampled_from(["flow", "block", "empty"]), min_size=1, max_size=4), NUMBER,
       st.booleans(), st.booleans(), SPACE)  # fmt: skip
def test_keys_are_moved_whatever_style_the_pairs_have(
    styles: list[str], number: str, drifts: bool, last: bool, space: str
) -> None:
    lines = ["coupling:", "  law: wave # x", f"  wave_filter_hz:  {number}", "  pairs:"]
    for k, style in enumerate(styles):
        keys = ["wave_impedance: 0.02", *(["drift_time_s: 2"] if drifts else [])]
        keys = keys[::-1] if last else keys
        if style == "block":
            lines += [f"    j{k}: # joint", *(f"      {key}  # {key}" for key in keys)]
        else:
            inner = ", ".join(keys) if style == "flow" else ""
            lines += [f"    j{k}: {{{space}{inner}{space}}}  # joint"]
    found = rewrite_older("\n".join(lines) + "\n", "bench.yaml")
    coupling = parse_yaml(found.text).value["coupling"]
    assert "wave_filter_hz" not in coupling
    for k, style in enumerate(styles):
        expected = {"wave_filter_hz": float(number)}
        expected |= {} if style == "empty" else {"wave_impedance": 0.02}
        assert coupling["pairs"][f"j{k}"] == expected
    assert found.text.count("#") == "\n".join(lines).count("#")


def test_what_cannot_be_rewritten_line_by_line_is_said() -> None:
    text = "coupling: {law: wave, wave_filter_hz: 100, pairs: {j1: {wave_impedance: 1}, j2: \n {}}}"
    with pytest.raises(ConfigError, match=r"by hand: line 1: coupling\.wave_filter_hz removed"):
        rewrite_older(text, "bench.yaml")
    with pytest.raises(ConfigError, match="no mapping"):
        rewrite_older("- 1\n", "bench.yaml")
