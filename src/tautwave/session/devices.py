"""The simulated devices of a run: served by it, found at a server, or served for another run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any

from tautwave.config import Rig
from tautwave.errors import ConfigError, DriverError
from tautwave.rig import BusWay, Simulate, Way, bus_ways, overlaid
from tautwave.session.bus_locks import sole_master
from tautwave.session.registration import RUN, SIM, Server, find_server, registered, start
from tautwave.session.serving import Announce, bus_bench, interrupted, serve, served


def describe_ways(
    rig: Rig, *, clock: str = "real", simulate: Simulate = (), attach: bool = False
) -> list[str]:
    """Return one line per bus on how it runs, from `bus_ways`.

    Raises
    ------
    ConfigError
        As for `bus_ways`.
    DriverError
        `attach`, and the devices are not served.
    """
    ways = bus_ways(rig, clock=clock, simulate=simulate, attach=attach)
    if attach:
        ways = attached(rig, ways)
    width = max(len(name) for name in ways)
    why = " (--clock fake)" if clock == "fake" else ""
    return [f"bus {name:<{width}}  {way.describe()}{why}" for name, way in ways.items()]


@contextmanager
def devices(rig: Rig, ways: Mapping[str, BusWay]) -> Iterator[dict[str, BusWay]]:
    """Provide the simulated devices of a run inside the block; yield the ways with their endpoints.

    The run is the only master of its endpoints on this machine meanwhile.

    Raises
    ------
    DriverError
        They do not start, an endpoint is already served or has a master, or devices expected
        elsewhere are not served.
    """
    announced = attached(rig, ways)
    buses = _of(announced, Way.SERVED)
    named = _named(announced, buses)
    alone = registered(rig, RUN, named) if named else nullcontext()
    with alone, served(overlaid(rig, announced), buses) as lines:
        for name, line in lines.items():
            announced[name] = _led(announced[name], line)
        with sole_master({name: way.endpoint for name, way in announced.items()}):
            yield announced


def attached(rig: Rig, ways: Mapping[str, BusWay]) -> dict[str, BusWay]:
    """Return the ways with the announcements of this rig's server.

    An endpoint named in the rig (vcan, UDP multicast) needs no known server.

    Raises
    ------
    DriverError
        A bus without its own endpoint is not served, or its server has died.
    """
    with_server = dict(ways)
    buses = [] if rig.simulation is None else _of(ways, Way.ELSEWHERE)
    if not buses:
        return with_server
    server = find_server(rig)
    for name in buses:
        line = None if server is None else server.buses.get(name)
        if server is not None and line is not None:
            with_server[name] = _led(ways[name], line)._replace(server=server.pid)
        elif not ways[name].endpoint:
            raise DriverError(_not_served(rig, name, ways[name], server))
    return with_server


def _not_served(rig: Rig, name: str, way: BusWay, server: Server | None) -> str:
    again = start(rig, *([name] if way.forced else []))
    if server is None:
        return f"{rig.name}: --attach: no process serves the devices of bus {name} here; {again}"
    return (
        f"{rig.name}: --attach: {server.describe()} does not serve bus {name}, or not yet; wait a "
        f"moment, or stop it and {again}"
    )


def _led(way: BusWay, line: Mapping[str, Any]) -> BusWay:
    """Return a way with the announcement of its devices' server."""
    options = {**way.options, **line.get("options", {})}
    return way._replace(endpoint=str(line["endpoint"]), options=options)


def _of(ways: Mapping[str, BusWay], way: Way) -> list[str]:
    return [name for name, bus_way in ways.items() if bus_way.way is way]


def _named(ways: Mapping[str, BusWay], buses: Sequence[str]) -> list[str]:
    """Return the served endpoints that the rig names."""
    return [ways[name].endpoint for name in buses if ways[name].endpoint]


def serve_rig(
    rig: Rig, simulate: Simulate, announce: Announce, ready: Callable[[Sequence[str]], None]
) -> None:
    """Serve the simulated devices of a rig until SIGINT or SIGTERM, for `run --attach` and others.

    Parameters
    ----------
    rig : Rig
        A checked rig.
    simulate : bool or collection of str
        Buses to simulate although they name hardware.
    announce : callable
        Called once per endpoint.
    ready : callable
        Called when everything is announced, with the buses that need `--simulate` in the run.

    Raises
    ------
    ConfigError
        There is nothing to serve.
    DriverError
        The rig, or one of its endpoints, is already served; or one cannot be opened.
    """
    if rig.simulation is None:
        raise ConfigError(
            f"{rig.name}: there is nothing to simulate; add a simulation block to the rig file"
        )
    ways = bus_ways(rig, simulate=simulate)
    buses = _of(ways, Way.SERVED)
    if not buses:
        raise ConfigError(_nothing_to_serve(rig, ways))
    forced = [name for name in buses if ways[name].forced]
    rig = overlaid(rig, ways)
    with registered(rig, SIM, _named(ways, buses)) as mine:

        def tell(name: str, line: Mapping[str, Any]) -> None:
            mine.announce(name, line)
            announce({"bus": name, **line})

        if len(buses) == 1:
            (name,) = buses

            def tell_all(line: Mapping[str, Any]) -> None:
                tell(name, line)
                ready(forced)

            serve(rig.buses[name].driver, bus_bench(rig, name), tell_all, rig.loop.fifo_priority)
            return
        with served(rig, buses) as lines, interrupted() as asked:
            for name, line in lines.items():
                tell(name, line)
            ready(forced)
            asked()


def _nothing_to_serve(rig: Rig, ways: Mapping[str, BusWay]) -> str:
    hardware = _of(ways, Way.HARDWARE)
    if hardware:
        named = ", ".join(f"bus {name} at {ways[name].endpoint}" for name in hardware)
        return (
            f"{rig.name}: it names hardware ({named}); --simulate serves simulated devices in its "
            "place"
        )
    return (
        f"{rig.name}: its simulated devices run inside the run's process; there is nothing to serve"
    )
