"""`sim` and `scan`: options made of a plugin's model, one line of JSON, sentences for mistakes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Annotated, Any

import pytest
from click.testing import Result
from pydantic import BaseModel, ConfigDict, Field

from tautwave import registry
from tautwave.contracts import (
    Bench,
    Budget,
    BusSpec,
    DriverPlugin,
    ScanProgress,
    SimulatorPlugin,
)

Cli = Callable[..., Result]


class Asked(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    ids: tuple[Annotated[int, Field(ge=1)], ...] = Field(
        default=(1,), min_length=1, description="Numbers on the bus."
    )
    model: str = Field(description="What they are.")
    baud_rate: int = Field(default=1_000_000, gt=0, description="[bit/s]")
    slow: bool = Field(default=False, description="Answer late.")


def _never(*_: Any) -> Any:
    raise NotImplementedError


def _scan(options: Asked, progress: ScanProgress) -> Sequence[Mapping[str, Any]]:
    progress(0.5, "1 found")
    if options.slow:
        return []
    return [
        {"id": number, "model": options.model, "errors": ["hot", "loud"] if number > 1 else None}
        for number in options.ids
    ]


def _serve(
    options: Any,
    bus: BusSpec,
    physics: Sequence[Any],
    announce: Callable[[Mapping[str, Any]], None],
    stopped: Callable[[], bool],
) -> None:
    assert not stopped()
    announce({"driver": "acme", "endpoint": "/dev/acme", "ids": options.ids})


DRIVER = DriverPlugin(
    Asked, _never, lambda *_: Budget(0.0, 1.0, ""), _scan, (), True, "acme servos",
    scan_options=Asked,
)  # fmt: skip
SIMULATOR = SimulatorPlugin(
    Asked, _never, "acme servos", lambda _: True, _serve, Asked,
    lambda options: Bench(options, BusSpec("acme", (), 1000.0), ()),
)  # fmt: skip


@pytest.fixture(autouse=True)
def _installed(monkeypatch: pytest.MonkeyPatch) -> None:
    plugins = {registry.DRIVERS: DRIVER, registry.SIMULATORS: SIMULATOR}
    found = registry.entry_points()

    def select(group: str) -> list[Any]:
        acme = [SimpleNamespace(name="acme", load=lambda: plugins[group])]
        return [*found.select(group=group), *(acme if group in plugins else [])]

    monkeypatch.setattr(registry, "entry_points", lambda: SimpleNamespace(select=select))


def test_sim_announces_one_line_of_json(tautwave_cli: Cli) -> None:
    result = tautwave_cli("sim", "acme", "--model", "X", "--ids", "1-2,7")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found == {"driver": "acme", "endpoint": "/dev/acme", "ids": [1, 2, 7]}
    assert result.stdout.count("\n") == 1


def test_scan_is_a_table_or_json(tautwave_cli: Cli) -> None:
    words = ("scan", "acme", "--model=X", "--ids", "1,2")
    result = tautwave_cli(*words)
    assert result.exit_code == 0, result.output
    for text in ("Devices on acme", "errors", "hot, loud"):
        assert text in result.stdout
    assert json.loads(tautwave_cli(*words, "--json").stdout) == [
        {"id": 1, "model": "X", "errors": None},
        {"id": 2, "model": "X", "errors": ["hot", "loud"]},
    ]


def test_a_scan_shows_how_far_it_is(capfd: pytest.CaptureFixture[str], tautwave_cli: Cli) -> None:
    tautwave_cli("scan", "acme", "--model", "X")
    assert "scan acme:  50 %  1 found" in capfd.readouterr().err


def test_a_scan_of_others_that_takes_its_options_alone_shows_no_progress(
    monkeypatch: pytest.MonkeyPatch, tautwave_cli: Cli
) -> None:
    old = DRIVER._replace(scan=lambda options: [{"id": 4, "model": options.model}])
    monkeypatch.setattr(registry, "load_driver", lambda _: old)
    done = tautwave_cli("scan", "acme", "--model", "X", "--json")
    assert json.loads(done.stdout) == [{"id": 4, "model": "X"}]


@pytest.mark.parametrize(("driver", "option"), [("dynamixel", "--port"), ("modbus", "--endpoint")])
@pytest.mark.parametrize("found", [[], ["/dev/ttyUSB7"]])
def test_a_scan_without_a_port_names_those_there_are(
    tautwave_cli: Cli, monkeypatch: pytest.MonkeyPatch, driver: str, option: str, found: list[str]
) -> None:
    ports = [SimpleNamespace(device=name, description="FT232R") for name in found]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)
    done = tautwave_cli("scan", driver)
    assert done.exit_code == 2
    reported = f"scan {driver}: {option} is missing; "
    reported += "serial ports found: /dev/ttyUSB7 (FT232R)" if found else "no serial port is found"
    assert done.stderr.splitlines()[-1].startswith(reported)


@pytest.mark.parametrize("driver", ["dynamixel", "modbus", "canopen", "mit"])
def test_help_prints_no_default_that_is_none(tautwave_cli: Cli, driver: str) -> None:
    for command in ("scan", "sim"):
        reported = tautwave_cli(command, driver, "--help").stdout
        assert "--" in reported
        assert "None" not in reported
        assert "[default: ]" not in reported


def test_scan_that_finds_nothing_says_so(tautwave_cli: Cli) -> None:
    result = tautwave_cli("scan", "acme", "--model", "X", "--slow")
    assert result.exit_code == 0
    assert result.stdout == ""
    assert "no response on acme" in result.stderr
    assert tautwave_cli("scan", "acme", "--model", "X", "--slow", "--json").stdout == "[]\n"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--ids", "1"], "--model: Field required"),
        (["--model", "X", "--baudrate", "9600"], "did you mean --baud-rate?"),
        (["--model", "X", "--baud-rate", "fast"], "(got 'fast')"),
        (["--model", "X", "--baud-rate", "-5"], "greater than 0 (got -5)"),
        (["--model"], "--model needs a value"),
        (["--model", "X", "--ids", "1,two"], "(got 'two')"),
        (["--model", "X", "--ids", "0"], "--ids: Input should be greater than or equal to 1"),
        (["--model", "X", "--ids", ""], "at least 1 item"),
        (["stray", "--model", "X"], "no such option stray"),
    ],
)
@pytest.mark.parametrize("command", ["sim", "scan"])
def test_mistakes_are_sentences(
    tautwave_cli: Cli, command: str, words: list[str], sentence: str
) -> None:
    result = tautwave_cli(command, "acme", *words)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert result.stderr.startswith(f"{command} acme:")
    assert "Traceback" not in result.output
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize("command", ["sim", "scan"])
def test_help_of_a_driver_lists_its_options(tautwave_cli: Cli, command: str) -> None:
    result = tautwave_cli(command, "acme", "--help")
    assert result.exit_code == 0
    for text in ("--baud-rate", "[bit/s]", "[default: 1000000]", "Numbers on the bus."):
        assert text in result.stdout
    for words in ((command,), (command, "--help")):
        assert "Usage:" in tautwave_cli(*words).stdout


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("sim", "loopback"), "loopback has no endpoint"),
        (("scan", "loopback"), "loopback does not support scanning"),
        (("sim", "nosuch"), "unknown simulator 'nosuch'"),
        (("scan", "nosuch"), "unknown driver 'nosuch'"),
        (("sim", "there/is/none.yaml"), "no such file"),
        (("sim", "rig.yaml", "--ids", "1"), "--ids"),
    ],
)
def test_what_cannot_be_served_or_scanned(
    tautwave_cli: Cli, words: tuple[str, ...], sentence: str
) -> None:
    result = tautwave_cli(*words)
    assert result.exit_code == 2
    assert sentence in result.stderr


def test_served_devices_ask_for_the_priority_below_a_loop(
    tautwave_cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else devices on a busy machine answer late, and a run takes them for lost."""
    from contextlib import contextmanager

    from tautwave.session import serving

    asked = []

    @contextmanager
    def realtime(priority: int, cpu: int | None, lock_memory: bool) -> Any:
        asked.append((priority, cpu, lock_memory))
        yield []

    monkeypatch.setattr(serving, "realtime", realtime)
    assert tautwave_cli("sim", "acme", "--model", "X").exit_code == 0
    assert asked == [(49, None, False)]
