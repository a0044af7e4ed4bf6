"""Simulated MIT motors on CAN and CAN FD (Damiao), for the driver and for anybody else's client."""

from tautwave_sim.mit.plugin import simulator

__all__ = ["simulator"]
