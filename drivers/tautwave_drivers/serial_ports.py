"""The serial ports of this machine, for messages that ask for one."""

from __future__ import annotations


def port_names() -> list[str]:
    """Return the USB serial devices of this machine, such as /dev/ttyUSB0."""
    from serial.tools.list_ports import comports  # type: ignore[import-untyped]

    return sorted(str(port.device) for port in comports() if port.vid is not None)


def ports_found() -> str:
    """Return a clause on the serial ports there are, such as `/dev/ttyUSB0 (FT232R USB UART)`."""
    from serial.tools.list_ports import comports

    ports = sorted(comports(), key=lambda port: str(port.device))
    if not ports:
        return "no serial port is found on this machine; is the adapter plugged in?"
    names = [
        port.device + (f" ({port.description})" if port.description not in ("n/a", "") else "")
        for port in ports
    ]
    return f"serial ports found: {', '.join(names)}"
