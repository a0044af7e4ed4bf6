#!/usr/bin/env bash
# The plugin as it is installed: wheels of tautwave and of it in a new environment, where the
# contract is tested against a stand-in for LeRobot. Needs `python -m build`, some 200 MB, no torch.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python=${PYTHON:-python3}
for source in "$root" "$root/drivers/lerobot_robot_tautwave"; do
    "$python" -m build --wheel --outdir "$work/wheels" "$source" >"$work/build.log"
done
"$python" -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet "$work"/wheels/tautwave-*.whl pytest
"$work/venv/bin/python" -m pip install --quiet --no-deps "$work"/wheels/lerobot_robot_tautwave-*.whl

mkdir -p "$work/tests" # without the sources beside it: what is imported is what was installed
touch "$work/tests/__init__.py"
cp -r "$root/tests/lerobot" "$work/tests"
cp -r "$root/configs" "$work"
cd "$work"
venv/bin/python -m pytest -q -p no:cacheprovider tests/lerobot -k "not distribution"
venv/bin/python - <<'PYTHON'
import importlib.metadata
import importlib.util

names = [one.metadata["Name"] for one in importlib.metadata.distributions()]
assert "lerobot_robot_tautwave" in names, "LeRobot looks for names that begin so"
origin = importlib.util.find_spec("lerobot_robot_tautwave").origin
assert "site-packages" in origin, origin
print("installed, found by its name, keeps the contract:", origin)
PYTHON
