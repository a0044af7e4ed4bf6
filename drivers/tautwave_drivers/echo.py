"""Half-duplex adapters that return what they send: those bytes are taken out before anyone reads.

One that joins TX and RX without a switch hears itself. In protocol 1.0 a ping that comes back looks
like its answer.
"""

from __future__ import annotations

from typing import Any

from tautwave.contracts import BytePort, Clock


class Unechoed:
    """A serial port without its own echo, once `echoes` is set; else as it is.

    An echo that is disturbed is still one: as many bytes are taken out, whatever they are, until
    the next write. Else what is left of an instruction would be read as an answer. Where bytes of
    it were lost, those of an answer go in their place, which then has a wrong checksum.

    Parameters
    ----------
    port : BytePort
        What is opened; all but `write` and `read` is its.
    """

    def __init__(self, port: BytePort) -> None:
        self._port = port
        self._expected = bytearray()
        self._disturbed = False
        self.echoes = False

    def write(self, data: bytes) -> None:
        """Send bytes; raises what the port does."""
        if self.echoes:
            if self._disturbed:
                self._expected.clear()  # what is still due of that one will not come
                self._disturbed = False
            self._expected += data
        self._port.write(data)

    def read(self) -> bytes:
        """Return what came from others; raises what the port does."""
        data = self._port.read()
        if not self._expected:
            return data
        count = min(len(data), len(self._expected))
        self._disturbed = self._disturbed or data[:count] != self._expected[:count]
        del self._expected[:count]
        return data[count:]

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def find_echo(self, clock: Clock, probe: bytes, wait_ns: int) -> None:
        """See whether the adapter echoes, by an instruction that no servo answers.

        Parameters
        ----------
        clock : Clock
            What waits.
        probe : bytes
            The instruction.
        wait_ns : int
            How long its echo may take [ns].
        """
        self._port.read()
        self._expected.clear()
        self._port.write(probe)
        until = clock.now_ns() + wait_ns
        heard = b""
        while len(heard) < len(probe) and clock.wait(self._port, until):
            heard += self._port.read()
        self.echoes = heard[: len(probe)] == probe

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)  # `fileno`, or what a clock runs in memory
