"""The JSON Schema agrees with the loader about the keys and the plain mistakes."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tautwave.config import parse_rig, resolved_yaml, rig_schema
from tautwave.config.text.yaml12 import parse_yaml

jsonschema = pytest.importorskip("jsonschema")
HERE = Path(__file__).parent
CONFIGS = sorted((HERE.parents[1] / "configs").glob("*.yaml"))


@cache
def plain(installed: bool) -> dict[str, Any]:
    """Return the schema with the installed entry points, or with the stand-ins."""
    found: dict[str, Any] = json.loads(json.dumps(rig_schema()))  # it has to be plain JSON
    jsonschema.Draft202012Validator.check_schema(found)
    return found


@pytest.fixture
def schema(request: pytest.FixtureRequest) -> dict[str, Any]:
    return plain(request.node.get_closest_marker("installed") is not None)


@pytest.fixture
def checker(schema: dict[str, Any]) -> Any:
    return jsonschema.Draft202012Validator(schema)


def _values(text: str) -> Any:
    return json.loads(json.dumps(parse_yaml(text).value))


@pytest.mark.sparse(5)
@pytest.mark.installed
@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_shipped_rigs_agree(path: Path, checker: Any) -> None:
    checker.validate(_values(path.read_text()))
    checker.validate(_values(resolved_yaml(parse_rig(path.read_text(), path))))


@pytest.mark.parametrize(
    "name",
    [
        "limit-negative", "limit-missing", "limit-misspelt", "limit-quoted", "unknown-block",
        "kind-wrong", "law-wrong", "offset-word", "range-three-numbers", "option-unknown",
        "option-negative", "option-third-party-missing", "reference-type-unknown",
        "damping-negative", "probability-above-one", "axis-not-full-name",
    ],
)  # fmt: skip
def test_wrong_rigs_do_not(name: str, checker: Any) -> None:
    text = (HERE / "wrong" / f"{name}.yaml").read_text()
    assert not checker.is_valid(_values(text))


def test_every_key_is_described(schema: dict[str, Any]) -> None:
    bare = [
        f"{block}.{key}"
        for block, definition in {"Rig": schema, **schema["$defs"]}.items()
        for key, value in definition.get("properties", {}).items()
        if "description" not in value and not block.endswith("Options") and "." not in block
    ]
    assert bare == []


def test_drivers_are_offered(schema: dict[str, Any]) -> None:
    bus = schema["$defs"]["Bus"]
    assert "loopback" in bus["properties"]["driver"]["examples"]
    assert "acme.Watchdog" in schema["$defs"]


def test_one_driver_that_does_not_load_spoils_nothing(schema: dict[str, Any]) -> None:
    cases = schema["$defs"]["Bus"]["allOf"]
    offered = [case["if"]["properties"]["driver"]["const"] for case in cases]
    assert offered == ["acme", "loopback", "open"]
