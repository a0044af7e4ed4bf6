"""Simulated CiA 402 drives on CANopen: device, drive and motor behind a bus with wire time."""

from tautwave_sim.canopen.plugin import simulator

__all__ = ["simulator"]
