"""Kernel, scheduler, memory, cores and clock; files are read below `root`, `/` but in tests."""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Iterator
from pathlib import Path

from tautwave.session.doctor.finding import BARS, COSTS, GOOD, UNKNOWN, Finding

LOCKED_BYTES = 512 * 2**20
"""What a run locks at most: interpreter, libraries and ring."""

LIMITS = "/etc/security/limits.d/99-tautwave.conf"
FAST_CLOCKS = ("tsc", "kvm-clock", "hyperv_clocksource_tsc_page", "arch_sys_counter")
RT_PACKAGES = {
    "debian": "sudo apt install linux-image-rt-amd64 && sudo reboot",
    "raspbian": "sudo apt install linux-image-rt-arm64 && sudo reboot",
    "ubuntu": "sudo pro attach && sudo pro enable realtime-kernel && sudo reboot",
    "fedora": "sudo dnf copr enable ycollet/audinux && sudo dnf install kernel-rt && sudo reboot",
}


def kernel(root: Path, version: str) -> Finding:
    """Look for PREEMPT_RT; `version` is that of `uname -v`."""
    if _read(root / "sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        return Finding("kernel", GOOD, "PREEMPT_RT")
    system = _system(root)
    return Finding(
        "kernel",
        COSTS,
        "not PREEMPT_RT",
        "other activity occasionally delays a cycle (measure: `tautwave bench loop`)",
        RT_PACKAGES.get(system, "install your distribution's real-time kernel"),
    )


def throttling(root: Path) -> Finding:
    """Look at how much of a second real-time tasks get before the kernel stops them."""
    runtime = _number(root / "proc/sys/kernel/sched_rt_runtime_us")
    period = _number(root / "proc/sys/kernel/sched_rt_period_us") or 1_000_000
    mend = "sudo sysctl -w kernel.sched_rt_runtime_us=950000"
    if runtime is None:
        return Finding("real-time throttling", UNKNOWN, "not reported by the kernel")
    if runtime < 0:
        return Finding(
            "real-time throttling", COSTS, "off",
            "a hung loop blocks its core, possibly with your terminal on it", mend,
        )  # fmt: skip
    share = f"{runtime / period:.0%} of each {1e-6 * period:g} s"
    if runtime < 0.8 * period:
        return Finding(
            "real-time throttling", COSTS, share, "the loop is suspended for the rest of it", mend
        )
    return Finding("real-time throttling", GOOD, share)


def priority(wanted: int) -> Finding:
    """Ask for SCHED_FIFO at `wanted`, and give it back."""
    what = "priority"
    if wanted == 0:
        return Finding(what, GOOD, "not requested (loop.fifo_priority: 0)")
    before, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(wanted))
    except OSError as err:
        limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
        return Finding(
            what,
            COSTS,
            f"SCHED_FIFO {wanted} refused ({err.strerror}); rtprio limit {limit}",
            "any other program may delay a cycle",
            f"echo '{_user()} - rtprio 99' | sudo tee -a {LIMITS}   # then log in again",
        )
    os.sched_setscheduler(0, before, parameters)
    return Finding(what, GOOD, f"SCHED_FIFO {wanted} is allowed")


def memory(wanted: bool, limit: int, root_user: bool) -> Finding:
    """Judge the limit [bytes] of locked memory; -1: unlimited."""
    if not wanted:
        return Finding("locked memory", GOOD, "not requested (loop.lock_memory: false)")
    if limit == resource.RLIM_INFINITY or limit >= LOCKED_BYTES or root_user:
        return Finding("locked memory", GOOD, "allowed")
    return Finding(
        "locked memory",
        COSTS,
        f"limit {limit // 2**10} KiB",
        "memory may be paged out, and a page fault delays a cycle",
        f"echo '{_user()} - memlock unlimited' | sudo tee -a {LIMITS}   # then log in again",
    )


def governor(root: Path) -> Finding:
    """Look at the frequency governors of all cores."""
    files = sorted(root.glob("sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor"))
    names = sorted({name for name in map(_read, files) if name})
    if not names:
        return Finding("CPU governor", GOOD, "no frequency scaling")
    if names == ["performance"]:
        return Finding("CPU governor", GOOD, "performance")
    return Finding(
        "CPU governor",
        COSTS,
        ", ".join(names),
        "cores slow down between cycles, so each starts late and takes longer",
        "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
    )


def cores(count: int) -> Finding:
    """Judge the number of cores this process may use."""
    if count >= 2:
        return Finding("cores", GOOD, str(count))
    return Finding(
        "cores", COSTS, "1", "the recorder, a separate process, shares the loop's core",
        "use a machine with a second core",
    )  # fmt: skip


def clock(root: Path) -> Finding:
    """Look at the clock source and the resolution of timers."""
    folder = root / "sys/devices/system/clocksource/clocksource0"
    source = _read(folder / "current_clocksource")
    if time.clock_getres(time.CLOCK_MONOTONIC) > 1e-6:
        return Finding(
            "clock", BARS, "no high-resolution timers", "wake-ups are limited to kernel ticks",
            "boot without highres=off",
        )  # fmt: skip
    if not source:
        return Finding("clock", UNKNOWN, "not reported by the kernel")
    if source in FAST_CLOCKS:
        return Finding("clock", GOOD, source)
    mend = "the processor has no faster one"
    if "tsc" in _read(folder / "available_clocksource").split():
        mend = f"echo tsc | sudo tee /{folder.relative_to(root)}/current_clocksource"
    return Finding(
        "clock", COSTS, source, "each clock read is a system call, several per cycle", mend
    )


def examine(root: Path, wanted_priority: int, lock_memory: bool) -> Iterator[Finding]:
    """Yield every finding about the machine."""
    yield kernel(root, os.uname().version)
    yield throttling(root)
    yield priority(wanted_priority)
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    yield memory(lock_memory, limit, os.geteuid() == 0)
    yield governor(root)
    yield cores(len(os.sched_getaffinity(0)))
    yield clock(root)


def _system(root: Path) -> str:
    """Return the distribution's id, such as `debian`."""
    for line in _read(root / "etc/os-release").splitlines():
        if line.startswith("ID="):
            return line[3:].strip('"')
    return ""


def _user() -> str:
    return os.environ.get("USER") or str(os.getuid())


def _number(path: Path) -> int | None:
    try:
        return int(_read(path))
    except ValueError:
        return None


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
