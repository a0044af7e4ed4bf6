"""`sites`: two machines, one half of the rig on each."""

from __future__ import annotations

from ipaddress import ip_address
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from tautwave.config.keys.common import Block, NonNegative, Positive
from tautwave.config.keys.operate import Resting

SideName = Literal["master", "slave"]
PORT = 7447
Port = Annotated[int, Field(ge=1, le=65535)]


def without_port(bind: str, *, where: str = "sites.port") -> str:
    """Return an address to listen on; the port belongs to both sites, and is given at `where`.

    Raises
    ------
    ValueError
        It has a port.
    """
    if ":" in bind:
        try:
            ip_address(bind)
        except ValueError:
            raise ValueError(
                "an address without a port, such as 10.0.0.2 or ::1; the port is "
                f"{where} (got {bind!r})"
            ) from None
    return bind


class Site(Block):
    """One machine: where the other reaches it, and who it is."""

    address: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="Name or address at which the other site reaches this one; required for the "
        "serving site.",
    )
    bind: Annotated[str, AfterValidator(without_port)] = Field(
        default="", description="Address to listen on; empty: all addresses of this machine."
    )
    keys: Annotated[str, Field(min_length=1)] = Field(
        default="keys",
        description="Directory, relative to this file, with the site's .pem and .key and "
        "authority.pem; see `tautwave keys init`.",
    )


def _nowhere() -> Site:
    return Site()


class Sites(Resting):
    """Master and slave on two machines, joined over a network; see `tautwave run --site`."""

    serves: SideName = Field(
        default="slave",
        description="The site that listens; it must be reachable from the other one, by an open "
        "or forwarded port.",
    )
    port: Port = Field(
        default=PORT, description="TCP and UDP port (same number) of the serving site."
    )
    master: Site = Field(default_factory=_nowhere, description="The operator's machine.")
    slave: Site = Field(default_factory=_nowhere, description="The machine at the task.")
    wait_s: NonNegative = Field(
        default=60.0,
        description="[s] Time to wait for the other site before a run, and until it is ready in a "
        "session.",
    )
    greatest_backlog: Positive = Field(
        default=0.1,
        description="[rad | m, master] Missed motion up to which a session resumes after a "
        "silence; beyond it, a new session begins.",
    )
    place_tolerance: Positive = Field(
        default=0.05,
        description="[rad | m, master] Maximum distance of a slave from its target when a session "
        "begins; if it is farther away, it is moved there first. If less, "
        "`engage_tolerance` of a pair with an offset applies instead.",
    )
    here: SideName | None = Field(
        default=None,
        description="The half that this machine runs, as `--site` sets it; the other's buses are "
        "ignored.",
    )
