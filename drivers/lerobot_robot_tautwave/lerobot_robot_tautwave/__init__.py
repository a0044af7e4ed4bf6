"""A tautwave rig in LeRobot: a robot and a teleoperator that look at one run."""

from lerobot_robot_tautwave.config_tautwave import TautwaveMasterConfig, TautwaveSlaveConfig
from lerobot_robot_tautwave.devices import TautwaveMaster, TautwaveSlave

__all__ = ["TautwaveMaster", "TautwaveMasterConfig", "TautwaveSlave", "TautwaveSlaveConfig"]
