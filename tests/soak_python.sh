#!/usr/bin/env bash
# Installs the Python package of this commit as users do: from a fresh clone into an empty environment, with a release build. Then
# runs the notebooks, imports the package with each Python that FORMATION_PYTHONS names (separated by colons), and measures a plan of
# 1,000 modules against the command line. Usage: tests/soak_python.sh [PYTHON]
set -euo pipefail
python=${1:-python3}
repository=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
git clone --quiet "$repository" "$scratch/clone"
"$python" -m venv "$scratch/empty"
cd "$scratch/clone"
"$scratch/empty/bin/pip" install --quiet './python[notebooks]'
"$scratch/empty/bin/python" python/tests/run_notebooks.py
site=$("$scratch/empty/bin/python" -c 'import formation, pathlib; print(pathlib.Path(formation.__file__).parents[1])')
mkdir "$scratch/alone"
cp -r "$site/formation" "$scratch/alone"
IFS=: read -ra others <<<"${FORMATION_PYTHONS:-}"
for other in "${others[@]}"; do
    PYTHONPATH=$scratch/alone "$other" -c 'import formation, sys
plan = formation.plan(formation.Scenario.generate(12, 12, seed=1, mixed=True))
print(sys.version.split()[0], len(plan.assignments), "modules planned")'
done
cargo build --release --locked --quiet --package formation
FORMATION_PROGRAM=target/release/formation "$scratch/empty/bin/python" python/tests/measure_plan.py 1000 5
cargo build --workspace --bins --locked --quiet
cargo test --package formation_python --test all --locked -- --ignored ros::
