#!/usr/bin/env bash
# Builds the wheel into a venv of its own (target/python) and tests it there: pytest, mypy, stubtest. Needs Python 3.10 or
# later with pip. The wheel has the profile of the tests: what they have compiled is not compiled again.
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(realpath --canonicalize-missing "${CARGO_TARGET_DIR:-target}")
venv=$target/python
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
python=$venv/bin/python
"$python" -m pip install --quiet --disable-pip-version-check -r python/requirements.txt
export PYO3_PYTHON=$python
rm -rf "$target/wheels"
"$venv/bin/maturin" build --quiet --locked --profile dev --auditwheel skip --out "$target/wheels"
"$python" -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps "$target"/wheels/*.whl
"$python" -m mypy
"$python" -m mypy.stubtest nav_sim._native
"$python" -m pytest --quiet python/tests
