"""A file runs in the process of pytest itself, all tests in workers."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from tests.workers import names_only_files

HERE = "tests/house/test_workers.py"


@pytest.mark.parametrize(
    ("args", "alone"),
    [
        ((), False),
        (("-q", "-m", "slow"), False),
        (("tests",), False),
        (("tests/house", HERE), False),
        ((HERE,), True),
        (("-q", f"{HERE}::test_workers", "tests/conftest.py"), True),
        (("-k", "wall", HERE), True),
        (("--timeout=9",), False),
        (("tests/no_such_file.py",), False),
    ],
)
def test_workers(args: tuple[str, ...], alone: bool) -> None:
    assert names_only_files(args) is alone


def test_xdist_is_told_so(pytestconfig: pytest.Config) -> None:
    named = SimpleNamespace(invocation_params=SimpleNamespace(args=(HERE,)))
    assert pytestconfig.hook.pytest_xdist_auto_num_workers(config=named) == 0
