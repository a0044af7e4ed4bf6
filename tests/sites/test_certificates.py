"""Keys of two sites: what TLS of the standard library makes of them."""

from __future__ import annotations

import ssl
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.cli import main as cli
from tautwave.errors import ConfigError
from tautwave.sites.certificates import identity_files, make_authority


def test_each_site_gets_a_certificate_that_names_it(tmp_path: Path) -> None:
    written = make_authority(tmp_path / "keys", ["lab", "clinic"])
    assert [path.name for path in written] == [
        "authority.pem", "lab.pem", "lab.key", "clinic.pem", "clinic.key"
    ]  # fmt: skip
    assert (tmp_path / "keys" / "lab.key").stat().st_mode & 0o777 == 0o600
    files = identity_files(tmp_path / "keys", "lab")
    context = ssl.create_default_context(cafile=str(files.authority))
    context.load_cert_chain(files.certificate, files.key)
    found = ssl._ssl._test_decode_cert(str(files.certificate))  # type: ignore[attr-defined]
    assert found["subjectAltName"] == (("DNS", "lab"),)


@pytest.mark.parametrize(
    ("sites", "sentence"),
    [
        (["master"], "a session joins two sites of different names"),
        (["a", "a"], "a session joins two sites of different names"),
        (["authority", "b"], "'authority' is not a valid site name"),
        (["A B", "b"], "'A B' is not a valid site name"),
        (["../x", "b"], "is not a valid site name"),
    ],
)
def test_names_that_are_none_are_refused(tmp_path: Path, sites: list[str], sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        make_authority(tmp_path / "keys", sites)
    assert not (tmp_path / "keys").exists()


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    make_authority(tmp_path, ["a", "b"])
    before = (tmp_path / "a.key").read_bytes()
    with pytest.raises(ConfigError, match="not empty; give a new directory"):
        make_authority(tmp_path, ["a", "b"])
    assert (tmp_path / "a.key").read_bytes() == before


def test_missing_files_are_named_with_the_remedy(tmp_path: Path) -> None:
    make_authority(tmp_path, ["a", "b"])
    (tmp_path / "a.key").unlink()
    with pytest.raises(ConfigError, match=r"a\.key: missing; make them with: tautwave keys init"):
        identity_files(tmp_path, "a")


def test_the_command(tmp_path: Path) -> None:
    runner = CliRunner()
    done = runner.invoke(cli, ["keys", "init", str(tmp_path / "k"), "--site", "a", "--site", "b"])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "k" / "b.pem").exists()
    again = runner.invoke(cli, ["keys", "init", str(tmp_path / "k")])
    assert again.exit_code == 2
    assert "not empty; give a new directory" in again.output
    taken = tmp_path / "file"
    taken.write_text("")
    refused = runner.invoke(cli, ["keys", "init", str(taken / "k")])
    assert refused.exit_code == 2
    assert "cannot be a directory" in refused.output
