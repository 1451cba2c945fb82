#!/usr/bin/env bash
# What comparisons promise, with more instances than a test has: 200 simulated runs from Python and from the command line; five allocations
# that the target gives, formed by processes; a comparison of 4 policies on 200 instances that is killed again and again, and goes on to the
# same rows; instances of CG:SHOP 2021, whose solutions the contest's checker judges. FORMATION_CGSHOP names a folder of the contest's own
# instances; without it some are drawn.
# Usage: tests/soak_comparisons.sh [PYTHON], which has what python/requirements.txt lists. Needs a release build of the workspace.
set -euo pipefail
repository=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
python=${1:-python3}
release=${CARGO_TARGET_DIR:-$repository/target}/release
formation=$release/formation
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cp -r "$repository/python/formation" "$scratch/formation"
cp "$release/libformation_native.so" "$scratch/formation/_native.abi3.so"
export PYTHONPATH=$scratch FORMATION_PROGRAM=$formation PYTHONDONTWRITEBYTECODE=1

FORMATION_SIMULATED=200 "$python" -m pytest -q -p no:cacheprovider "$repository/python/tests/test_equality.py" -k simulated_runs_of_generated
"$python" "$repository/python/tests/draw_given.py" "$scratch" 5
for scenario in "$scratch"/given_*.yaml; do
    "$formation" run "$scenario" --domain "${ROS_DOMAIN_ID:-78}" --json 2>/dev/null >"$scratch/run.json"
    "$python" "$repository/python/tests/draw_given.py" "$scratch/run.json" "$scenario"
done

policies=(--policy exact --policy paper --policy auction --policy hungarian)
instances=(--kinds mixed,3x4 --sizes 20,40 --seeds 1-50 --motion)
"$formation" compare "$scratch/whole" "${policies[@]}" "${instances[@]}" >/dev/null 2>&1
for seconds in 1 2 3; do
    timeout --signal=KILL "$seconds" "$formation" compare "$scratch/cut" "${policies[@]}" "${instances[@]}" >/dev/null 2>&1 || true
    echo "killed after $(wc -l <"$scratch/cut/rows.jsonl") rows"
done
"$formation" compare "$scratch/cut" "${policies[@]}" "${instances[@]}" >/dev/null 2>&1
for file in rows.csv rows.jsonl summary.md; do
    cmp "$scratch/whole/$file" "$scratch/cut/$file"
done
echo "$(($(wc -l <"$scratch/whole/rows.csv") - 1)) rows, interrupted and not: the same"

"$python" "$repository/python/tests/measure_cgshop.py" 1000 ${FORMATION_CGSHOP:+"$FORMATION_CGSHOP"}
