"""From power-on to NMT operational: every drive checked, set up, read back, and started.

Nothing here enables a drive: torque is off before anything is written and stays off.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from tautwave.contracts import BusSpec, Clock, FramePort
from tautwave.device_settings import Lasts
from tautwave.errors import BusTimeout, ConfigError, DeviceFault, DriverError
from tautwave_drivers.can.full_queue import queue_remedy
from tautwave_drivers.canopen.axis import Axis, ResponseTime
from tautwave_drivers.canopen.files.belonging import (
    IDENTITY,
    check_files,
    of_another,
    parameters,
)
from tautwave_drivers.canopen.files.choosing import choose
from tautwave_drivers.canopen.files.reading import read_device_file
from tautwave_drivers.canopen.foresight import files_of
from tautwave_drivers.canopen.health import (
    OPERATIONAL,
    SYNC_ID,
    Health,
    state_text,
)
from tautwave_drivers.canopen.mapping import RPDO_1, RPDO_2, TPDO_1, Layout, mappings_of
from tautwave_drivers.canopen.network import PolledNetwork, RemoteDrive
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.canopen.setup.meaning import ZEROED, check_meaning
from tautwave_drivers.canopen.setup.pdo import map_pdo, silence_others
from tautwave_drivers.canopen.setup.settings import (
    check_identity,
    check_sync,
    free_emergencies,
    limit_torque,
    not_stored,
    require,
    set_period,
    set_watchdogs,
    store,
    verify,
)
from tautwave_drivers.cia402 import communication as c
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.modes import mode_name
from tautwave_drivers.cia402.states import DISABLE_VOLTAGE, TORQUE_STATES, decode, status_text

NMT_START, NMT_PRE_OPERATIONAL = 0x01, 0x80
SYNCHRONOUS, ON_EVENT = 1, 255
TORQUE_OFF_S = 1.0
START_S = 1.0
PROBES = 5
PROBE_S = 0.05
MIN_SPREAD_NS = 30_000
SECOND_RESPONSE_NS = 10_000_000
"""How long the response of a second node is waited for."""


def bring_up(
    options: CanopenOptions,
    bus: BusSpec,
    axes: Sequence[Axis],
    health: Health,
    port: FramePort,
    clock: Clock,
) -> tuple[PolledNetwork, list[str]]:
    """Bring all drives of a bus to NMT operational; return the network and what was done.

    Raises
    ------
    DriverError
        A drive does not respond, is not the expected one, or refuses something.
    """
    arrivals: dict[int, int] = {}
    by_tpdo = {axis.tpdo_id: axis for axis in axes}

    def hear(can_id: int, data: bytes, arrival_ns: int) -> None:
        if can_id in by_tpdo:
            arrivals.setdefault(can_id, arrival_ns)
        else:
            health.take(can_id, data, arrival_ns)
            if health.lost:
                raise DriverError(f"bus {bus.name}: {health.lost}")

    net = PolledNetwork(port, clock, hear, options.sdo_timeout_s, queue_remedy(options))
    while port.receive() is not None:
        pass  # frames from before
    try:
        check_files(files_of([(axis.spec, axis.node) for axis in axes]))
    except ConfigError as err:  # it has changed since the rig was read
        raise DriverError(f"bus {bus.name}: {'; '.join(err.problems)}") from err
    drives = [net.remote(axis.node.id, axis.label, axis.loans) for axis in axes]
    notes: list[str] = []
    try:
        for drive, axis in zip(drives, axes, strict=True):
            drive.nmt(NMT_PRE_OPERATIONAL)
            notes += check_identity(drive, axis)
            _check_alone(net, drive, clock)
            health.booted.discard(axis.node.id)  # it responds: powered on just before, if at all
            notes += prepare(drive, axis, options, bus, clock)
        for drive in drives:
            drive.nmt(NMT_START)
        _await_operational(net, axes, health, clock, bus)
        if options.sync:
            notes += _measure_response_times(net, axes, arrivals, options, bus, clock)
        _check_restarts(axes, health)
        for drive in drives:
            verify(drive)
    except BaseException:  # a start that is refused, or ended by Ctrl-C, leaves nothing behind
        for drive in drives:
            drive.settings.give_back()
            with suppress(DriverError):  # what it was refused for is what is said
                drive.nmt(NMT_PRE_OPERATIONAL)
        raise
    return net, notes


def _check_alone(net: PolledNetwork, drive: RemoteDrive, clock: Clock) -> None:
    """Refuse a node of which a request got two responses.

    Raises
    ------
    DeviceFault
        Several did.
    """
    net.listen(clock.now_ns() + SECOND_RESPONSE_NS)
    if drive.answered_twice > 1:
        raise DeviceFault(
            f"{drive.name}: two responses to one request: two nodes have the id {drive.node_id} "
            "(or another SDO client talks to it); give each node its own id, by its switches or "
            "its tool"
        )


def prepare(
    drive: RemoteDrive, axis: Axis, options: CanopenOptions, bus: BusSpec, clock: Clock
) -> list[str]:
    """Check one drive and write all it needs; it is pre-operational, and stays so."""
    notes = torque_off(drive, clock, bus)
    notes += _dcf(drive, axis)
    notes += check_meaning(drive, axis, options.master_id)
    _require_targets(drive, axis)
    notes += check_sync(drive)
    notes += free_emergencies(drive)
    notes += set_period(drive, bus)
    notes += limit_torque(drive, axis)
    notes += set_watchdogs(drive, axis, options, allow_unwatched=bus.allow_unwatched)
    notes += _map(drive, axis, options, bus)
    notes += _homing(drive, axis)
    for target in ZEROED:
        if drive.find(target, surely=True):
            remedy = "a leftover target would act as soon as the drive is enabled"
            require(drive, target, 0, remedy, Lasts.POWER)
    drive.write(o.MODE, axis.mode)  # no setting: the cycle commands it, and 6061h shows it
    if axis.node.mode_display == "when_enabled":
        remedy = "6061h does not show its mode before it is enabled, and this does not either"
        require(drive, o.MODE, axis.mode, remedy, Lasts.POWER)
    if drive.slow_s is not None:
        notes.append(
            f"{drive.name} responds slowly: it was given {drive.slow_s:g} s; state "
            f"sdo_timeout_s: {drive.slow_s:g} on its bus for a faster start"
        )
    notes += store(drive) if bus.configure else not_stored(drive)
    return [text for text in notes if text]


def _require_targets(drive: RemoteDrive, axis: Axis) -> None:
    """Refuse a drive that does not have what the axis commands and measures.

    Raises
    ------
    DeviceFault
        It does not: some take a mapping of such an object all the same.
    """
    needed = [o.TARGET_VELOCITY, o.TORQUE] if axis.servo else [o.TARGET_TORQUE]
    for entry in (*needed, o.POSITION):
        if drive.lacks(entry):
            raise DeviceFault(
                f"{drive.name} has no {entry.address} {entry.name}, which "
                f"{mode_name(axis.mode)} needs; use a drive or firmware that has it"
            )


def torque_off(drive: RemoteDrive, clock: Clock, bus: BusSpec) -> list[str]:
    """Disable the voltage and verify that the torque is off.

    Raises
    ------
    DeviceFault
        It is not off within a second.
    """
    drive.write(o.CONTROLWORD, DISABLE_VOLTAGE)
    deadline = clock.now_ns() + round(TORQUE_OFF_S * 1e9)
    while decode(word := drive.number(o.STATUSWORD)) in TORQUE_STATES:
        if clock.now_ns() > deadline:
            raise DeviceFault(
                f"{drive.name} stays in {status_text(word)} after disable voltage; cut its power"
            )
        clock.sleep_until(clock.now_ns() + bus.period_ns)
    return [f"{drive.name}: torque off, {status_text(word)}"]


def _dcf(drive: RemoteDrive, axis: Axis) -> list[str]:
    """Write the parameter values of a DCF that tune the drive, where it holds others."""
    if axis.node.eds is None:
        return []
    file = read_device_file(axis.node.eds)
    identity = {name: drive.find(entry) for name, (entry, _) in IDENTITY.items()}
    if problem := of_another(file, identity, "it has"):
        raise DeviceFault(f"{drive.name}: {problem}")
    choice = choose(parameters(file, drive.node_id), axis.node.dcf_include)
    written = sum(drive.write_setting(one) for one in choice.written)
    notes = [*file.remarks]
    if choice.note:
        notes.append(f"{drive.name}: of {file.path} {choice.note}")
    return [
        *notes,
        f"{drive.name}: {len(choice.written)} parameter values of {file.path}: {written} written "
        f"and read back, {len(choice.written) - written} already in the drive",
    ]


def _map(drive: RemoteDrive, axis: Axis, options: CanopenOptions, bus: BusSpec) -> list[str]:
    """Map the cyclic PDOs, and that of a move if there is one; all others are switched off."""
    used = {SYNC_ID, *(kind + one.device_id for one in bus.axes for kind in (TPDO_1, RPDO_1))}
    if axis.node.move is not None:
        used.add(RPDO_2 + axis.node.id)
    named = (
        () if axis.node.eds is None else {at for at, _ in read_device_file(axis.node.eds).objects}
    )
    notes = silence_others(drive, used, named)
    kind = SYNCHRONOUS if options.sync else ON_EVENT
    pdo = c.tpdo(1)
    timing = {pdo.inhibit_time: 0, pdo.timer: 0, pdo.sync_start: 0}
    if not options.sync:
        timing[pdo.timer] = bus.period_ns // 1_000_000
        if drive.find(pdo.timer) is None:
            raise DeviceFault(
                f"{drive.name} has no {pdo.timer.address}: without SYNC a drive has to send by its "
                "event timer; use sync: true"
            )
    wanted = mappings_of(axis.spec.causality, axis.node)
    sent = list(dict.fromkeys(one.tpdo for one in wanted))
    text, tpdo = map_pdo(drive, pdo, "TPDO1", axis.tpdo_id, kind, sent, timing)
    notes.append(text)
    kind = SYNCHRONOUS if options.rpdo == "sync" else ON_EVENT
    received = list(dict.fromkeys(one.rpdo for one in wanted))
    text, rpdo = map_pdo(drive, c.rpdo(1), "RPDO1", axis.rpdo_id, kind, received)
    notes.append(text)
    axis.map(rpdo, tpdo)
    move = axis.node.move
    if move is not None and (move.mode == "csp" or not axis.servo):
        target = o.TARGET_POSITION if move.mode == "csp" else o.TARGET_VELOCITY
        can_id = RPDO_2 + axis.node.id
        notes.append(map_pdo(drive, c.rpdo(2), "RPDO2", can_id, kind, [Layout((target,))])[0])
    return notes


def _homing(drive: RemoteDrive, axis: Axis) -> list[str]:
    keys = axis.node.homing
    if keys is None:
        return []
    remedy = "see the drive's manual for its homing methods and speeds"
    wanted = [(o.HOMING_METHOD, keys.method), (o.HOMING_FAST, keys.fast)]
    wanted += [(o.HOMING_SLOW, keys.slow), (o.HOMING_ACCELERATION, keys.acceleration)]
    return [
        require(drive, entry, value, remedy).text for entry, value in wanted if value is not None
    ]


def _await_operational(
    net: PolledNetwork, axes: Sequence[Axis], health: Health, clock: Clock, bus: BusSpec
) -> None:
    watched = [axis for axis in axes if axis.watched]
    ids = [axis.node.id for axis in watched]

    def up() -> bool:
        return all(health.states.get(node) == OPERATIONAL for node in ids)

    if net.listen(clock.now_ns() + round(START_S * 1e9), up):
        return
    hung = [axis for axis in watched if health.states.get(axis.node.id) != OPERATIONAL]
    words = "; ".join(
        f"{axis.label} shows {state_text(health.states.get(axis.node.id))}" for axis in hung
    )
    raise BusTimeout(
        f"bus {bus.name}: not NMT operational {START_S:g} s after NMT start: {words}; look "
        "for another master, or an error that keeps it there (1029h)"
    )


def _check_restarts(axes: Sequence[Axis], health: Health) -> None:
    """Refuse a drive that lost its power after it was set up: its limits are its own again."""
    for axis in axes:
        if axis.node.id in health.booted:
            raise DeviceFault(
                f"{axis.label}: it restarted while the drives were set up (boot-up frame), and "
                "has forgotten what was set; check its supply, then run again"
            )


def _measure_response_times(
    net: PolledNetwork,
    axes: Sequence[Axis],
    arrivals: dict[int, int],
    options: CanopenOptions,
    bus: BusSpec,
    clock: Clock,
) -> list[str]:
    """Send some SYNCs well apart, and measure how long each drive takes to respond."""
    times: dict[int, list[int]] = {axis.tpdo_id: [] for axis in axes}
    for _ in range(PROBES):
        arrivals.clear()
        begun = clock.now_ns()
        net.send_message(SYNC_ID, b"")
        net.listen(begun + round(PROBE_S * 1e9), lambda: len(arrivals) == len(axes))
        for can_id, arrival_ns in arrivals.items():
            times[can_id].append(arrival_ns - begun)
        quiet = begun + bus.period_ns
        while net.pump(quiet):
            pass
    notes = []
    timeout_ns = options.answer_share * bus.period_ns
    for axis in axes:
        taken = sorted(times[axis.tpdo_id])
        if not taken:
            raise BusTimeout(
                f"{axis.label} sends no TPDO1 (0x{axis.tpdo_id:03X}) on SYNC although it is "
                "operational; look for a second node with its id, or a different SYNC COB-ID in "
                "1005h"
            )
        best, usual = taken[0], taken[len(taken) // 2]
        if best > timeout_ns:
            raise BusTimeout(
                f"{axis.label} responds to SYNC after {best * 1e-3:.0f} us at best, but only "
                f"{timeout_ns * 1e-3:.0f} us of a period are available: lower rate_hz"
            )
        spread = max(MIN_SPREAD_NS, taken[-1] - best)
        axis.response_time = ResponseTime(best // 2, usual - spread, usual + spread)
        notes.append(
            f"{axis.label}: responds to SYNC after {best * 1e-3:.0f} us at best, "
            f"{usual * 1e-3:.0f} us usually ({len(taken)} of {PROBES} probes)"
        )
    return notes


def shut_down(net: PolledNetwork, axes: Sequence[Axis], bus: BusSpec) -> dict[str, str]:
    """Give back 6072h and the watchdogs of drives that are off, then NMT pre-operational.

    A drive that is not verified to be off keeps its watchdogs: they end its torque once this
    program is silent. Returns why, for each of those, by axis.
    """
    doubtful = {}
    for axis in axes:
        drive = net.drives.get(axis.node.id)
        if drive is None:
            continue
        try:
            torque_off(drive, net.clock, bus)  # by SDO: RPDOs may not have reached it
        except DriverError as err:
            doubtful[axis.spec.name] = str(err)
            continue
        drive.settings.give_back()
        drive.nmt(NMT_PRE_OPERATIONAL)
    end = net.clock.now_ns() + bus.period_ns
    while net.pump(end):
        pass
    return doubtful
