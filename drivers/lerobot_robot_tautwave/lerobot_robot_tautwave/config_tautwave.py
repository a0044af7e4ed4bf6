"""What LeRobot's command line may set: `--robot.rig=arms.yaml --teleop.rig=arms.yaml`."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.robots import RobotConfig
from lerobot.teleoperators import TeleoperatorConfig


@RobotConfig.register_subclass("tautwave_slave")
@dataclass(kw_only=True)
class TautwaveSlaveConfig(RobotConfig):
    """The slave of a rig.

    Attributes
    ----------
    rig : str
        Rig file.
    out : str
        Directory for the runs; each gets one of its own in it.
    engage : bool
        Whether to align and engage on connecting; else a person does (`tautwave view`).
    drive : str
        `hand`: a person leads the rig's master. `policy`: actions do, through a virtual hand.
    fps : float
        Actions a second, with `drive=policy`.
    allow_unwatched : bool
        Whether devices without a watchdog may run, such as Feetech servos.
    """

    rig: str
    out: str = "runs/lerobot"
    engage: bool = True
    drive: str = "hand"
    fps: float = 30.0
    allow_unwatched: bool = False


@TeleoperatorConfig.register_subclass("tautwave_master")
@dataclass(kw_only=True)
class TautwaveMasterConfig(TeleoperatorConfig):
    """The master of a rig; as `TautwaveSlaveConfig`. Both name the same rig file."""

    rig: str
    out: str = "runs/lerobot"
    engage: bool = True
    allow_unwatched: bool = False
