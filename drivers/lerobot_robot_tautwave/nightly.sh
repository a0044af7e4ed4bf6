#!/usr/bin/env bash
# The plugin under LeRobot's own commands: needs an environment with lerobot[dataset] (5 GB),
# tautwave and this plugin, all of which it finds on PATH. Simulated devices; nothing is sent out.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
export HF_HUB_OFFLINE=1 HF_HOME=$work/hf HF_LEROBOT_HOME=$work/home
tautwave example bench-2axis-loopback
rig=bench-2axis-loopback.yaml
both=(--robot.type=tautwave_slave "--robot.rig=$rig" --teleop.type=tautwave_master "--teleop.rig=$rig")

lerobot-teleoperate "${both[@]}" --fps 30 --teleop_time_s 3
lerobot-record "${both[@]}" --dataset.repo_id=me/try "--dataset.root=$work/recorded" \
    --dataset.fps=30 --dataset.num_episodes=2 --dataset.episode_time_s=2 --dataset.reset_time_s=1 \
    --dataset.single_task="press" --dataset.push_to_hub=False --play_sounds=False

# The same rig's own recordings, exported, are read by LeRobot, and have the same signals.
tautwave export runs/lerobot/* --to lerobot --fps 30 --task press --out exported
tautwave export runs/lerobot/* --to lerobot --fps 1000 --missing cut --task press --out fast
python - recorded exported fast <<'PYTHON'
import sys
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from torch.utils.data import DataLoader

recorded, exported, fast = (LeRobotDataset("me/try", root=root) for root in sys.argv[1:])
for root, fps in (("exported", 30), ("fast", 1000)):
    steps = {"action": [k / fps for k in range(8)], "observation.state": [-1 / fps, 0.0]}
    one = LeRobotDataset("me/try", root=root, episodes=[1], delta_timestamps=steps)
    batch = next(iter(DataLoader(one, batch_size=16, shuffle=True)))
    assert one.fps == fps
    assert batch["action"].shape == (16, 8, 2), batch["action"].shape
    assert batch["observation.state"].shape == (16, 2, 6), batch["observation.state"].shape
assert len(fast) > 25 * len(exported)
for key in ("action", "observation.state"):
    assert recorded.features[key]["names"] == exported.features[key]["names"], key
assert recorded.meta.total_episodes == 2 and len(recorded) >= 100
assert len(exported) > len(recorded)
print(len(recorded), "frames recorded,", len(exported), "exported, signals alike")
PYTHON

# A replay is a policy's action, and this rig is led by a hand.
if lerobot-replay --robot.type=tautwave_slave "--robot.rig=$rig" --dataset.repo_id=me/try \
    "--dataset.root=$work/recorded" --dataset.episode=0 --play_sounds=False 2>replay.log; then
    echo "a replay was not refused" >&2
    exit 1
fi
grep -q "led by a hand" replay.log

# Where a policy drives it, the same replay moves it.
lerobot-replay --robot.type=tautwave_slave "--robot.rig=$rig" --robot.drive=policy --robot.fps=30 \
    --dataset.repo_id=me/try "--dataset.root=$work/recorded" --dataset.episode=0 --play_sounds=False
echo "all of it holds"
