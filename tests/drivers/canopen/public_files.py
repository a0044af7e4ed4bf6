"""EDS and DCF files of real drives in public repositories: where they are, what comes of them.

    python -m tests.drivers.canopen.public_files FOLDER

fetches those that FOLDER lacks, each as its commit has it, and compares its SHA-256. None is kept
here: they belong to their makers. `test_public_files.py` tries what the folder named by
TAUTWAVE_PUBLIC_EDS has; TAUTWAVE_PUBLIC_EDS_URL, a pattern with {repository}, {commit} and {path},
names another place to fetch from.
"""

from __future__ import annotations

import hashlib
import os
import sys
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path
from typing import NamedTuple

FOLDER, URL = "TAUTWAVE_PUBLIC_EDS", "TAUTWAVE_PUBLIC_EDS_URL"
PATTERN = "https://raw.githubusercontent.com/{repository}/{commit}/{path}"

ROS = ("ros-industrial/ros_canopen", "99eefdd2b427b2d989bee3f3babb7c3d448f3340")
ROS_TOOLS = (ROS[0], "740673ebda519fd35cf76b6293f0b5ae9766c84b")
ROS_IPA = (ROS[0], "1239ef40f52d09c0f9f33b202c9a9754dd2df09b")
ROS_IPA_OLD = (ROS[0], "9f6c53d39bc3f16978fd90910d467ba19e0a84fe")
ROS_2 = (ROS[0], "c63d5fd9f2c97f2d513f14ef44935dc0c9b9c396")
ROS_2_FORK = ("starnus-software/ros2_canopen", "728e640d2192c0c6df93157c32e0a9b02bc60744")
ROS_2_TECHNOSOFT = (ROS_2_FORK[0], "81bb80ea5e7703acb5aaf1e6b324d6c18f5dbe6f")
PYTHON = ("christiansandberg/canopen", "e2013697400523e662360b0a37f5ae4961d92715")


class PublicFile(NamedTuple):
    """A file, and what comes of it.

    `refused`: in what `new --eds` says where it makes no rig. Else `said` is in what `check` says
    of the rig, and a simulated run with `options` ends well, or says `stopped`.
    """

    source: tuple[str, str]
    path: str
    sha256: str
    refused: tuple[str, ...] = ()
    said: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    stopped: str = ""

    @property
    def name(self) -> str:
        """Name of the file alone."""
        return self.path.rpartition("/")[2]


NO_CST = "has no CST cyclic synchronous torque: 6502:00"
FILES = (
    PublicFile(
        ROS_2_FORK, "config_package/config/gpl_bus/CL4-E-1-12.eds",
        "6e140e8b95cd788cd1f1ce3b6b219e0cf1d350133e520ac7c05dc20c23009263",
        said=("a run refuses the drive while it holds the default of its EDS: 6072:00 max torque",),
        stopped="6072:00 max torque is 100",
    ),
    PublicFile(
        ROS_TOOLS, "canopen_test_utils/config/Elmo.dcf",
        "483cbfb996b4ec864cc38106500a4356ecf354c79738b58f1f4057a8615fb589",
    ),
    PublicFile(
        ROS_IPA_OLD, "ipa_canopen_test/config/Whistle Gold V002.dcf",
        "0b1c663922fb64e7270a98d468882bf258976afd806b88f4d03b5a943da944a7",
        refused=("sets what a run refuses: 6076:00 motor rated torque is 0",),
    ),
    PublicFile(
        PYTHON, "examples/eds/e35.eds",
        "9bd986f09e0228562c0f43393251be63188908b60547b7a4b770ad6daf6dbaee",
        said=("1018:01 vendor is 0xFF (255), but [DeviceInfo] has 0x65 (101)",
              "according to its EDS it has no watchdog"),
        options=("--allow-unwatched",),
    ),
    PublicFile(
        ROS_2_TECHNOSOFT, "canopen_402_driver/config/technosoft.eds",
        "1e36fbe84676d4a9099d259c2f9123993bf87f1095922933edd81d4530e8fae8",
        refused=(f"{NO_CST} (0x1F0065)",),
    ),
    PublicFile(
        ROS, "canopen_chain_node/test/eds/ISD860.eds",
        "77c59272cc350510bdedbf13631130d2b6cbbcf929dd6013785a2f96ece24b61",
        refused=(f"{NO_CST} (0x65)", "has no 6071:00 target torque"),
    ),
    PublicFile(
        ROS, "canopen_chain_node/test/eds/ISD860.dcf",
        "7801e7f79ea9b7dbd9d088d28a821f3f8fca692403b868097451efb02b7805ed",
        refused=(f"{NO_CST} (0x65)",),
    ),
    PublicFile(
        ROS_IPA, "ipa_canopen_test/config/PRL120.eds",
        "6fbd467475be042244bd47c6144427a268b03affec8426acbdaad9dd9274b4f0",
        refused=(f"{NO_CST} (0x60)",),
    ),
    PublicFile(
        ROS_TOOLS, "canopen_test_utils/config/Schunk.eds",
        "6be9ff2cc5e273fe163011ef07780d7ba1a347c3106b27a61a09e0171066e093",
        refused=(f"{NO_CST} (0x63)",),
    ),
    PublicFile(
        ROS_TOOLS, "canopen_test_utils/config/Schunk_0_63.dcf",
        "6345efef4adf422640eddf44cb82f105f88d28523e3ee53cf481a27548eb2f93",
        refused=(f"{NO_CST} (0x63)",),
    ),
    PublicFile(
        ROS_2, "canopen_tests/config/robot_control/prbt_0_1.dcf",
        "7a632a60290d9658f94125ee5082cc2d486bc55308371b5ea98241a23da04ee1",
        refused=(f"{NO_CST} (0x43)",),
    ),
    PublicFile(
        ROS_2, "canopen_tests/config/cia402/cia402_slave.eds",
        "2b50bda999906be6d97241bc52e4f82dd8c89b027c5061bd316fe42ff103cdc5",
        refused=(f"{NO_CST} (0xA5)",),
    ),
    PublicFile(
        PYTHON, "test/sample.eds",
        "9987d2b081857a29fc0325b5e76a55aa4bf62200730af943caae4b503a3799d6",
        refused=("is given to nodes 1 and 2, but belongs to node 16 (its NodeID)",),
    ),
)  # fmt: skip


def fetch(folder: Path) -> list[str]:
    """Fetch what is missing; return a sentence about each file that is not there afterwards."""
    folder.mkdir(parents=True, exist_ok=True)
    pattern = os.environ.get(URL, PATTERN)
    missing = []
    for one in FILES:
        target = folder / one.name
        if target.exists():
            continue
        repository, commit = one.source
        path = urllib.parse.quote(one.path)
        address = pattern.format(repository=repository, commit=commit, path=path)
        try:
            with urllib.request.urlopen(address, timeout=20.0) as answer:
                data = answer.read(1 << 22)
        except (urllib.error.URLError, OSError, ValueError) as err:
            missing.append(f"{one.name}: {address}: {err}")
            continue
        if hashlib.sha256(data).hexdigest() != one.sha256:
            missing.append(f"{one.name}: {address} has another content than its table says")
            continue
        target.write_bytes(data)
    return missing


if __name__ == "__main__":
    for sentence in fetch(Path(sys.argv[1])):
        print(f"not fetched: {sentence}", file=sys.stderr)
