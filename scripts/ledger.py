"""The last column of docs/validation.md from a night's output: tests that passed, and the figures that they told.

    python3 scripts/ledger.py NIGHT docs/validation.md

A row's test is `crate::module` (a part of the names of its tests), a part of the night (`kills`, `disks`, `fuzz`), or nothing. A line
`figure MODULE: TEXT` of a test stands in the row of that module. A row without a test that ran is an error.
"""

import pathlib
import re
import sys

CRATES = {"nav_sim": "nav-sim", "nav_sim_signal": "signal", "nav_sim_calibration": "calibration", "nav_sim_navigation": "navigation",
          "nav_sim_document": "document", "nav_sim_logs": "logs"}
night, ledger = map(pathlib.Path, sys.argv[1:])

tests, figures, crate = {}, {}, ""
for file in sorted(night.glob("*.txt")):
    for line in file.read_text(encoding="utf-8", errors="replace").splitlines():
        if run := re.match(r"\s+Running (\S+)(?: \S+\.rs)? \(\S*?/deps/(\w+)-[0-9a-f]+", line):
            crate = CRATES.get(run[2], run[2]) if "unittests" in line else run[2]
        elif test := re.match(r"test (\S+) (?:- .*)?\.\.\. (ok|FAILED)", line):
            tests[f"{crate}::{test[1]}"] = test[2] == "ok"
        elif figure := re.match(r"figure (\S+): (.*)", line):
            if figure[1] != file.stem and (night / f"{figure[1]}.txt").exists():
                continue  # of a part, told by a shorter run among the tests
            figures.setdefault(figure[1], []).append(figure[2])

missing = []


def night_of(name):
    """What stands in the last column of the row of a test."""
    if name in figures and "::" not in name:
        return "; ".join(figures[name])
    module = name.split("::", 1)[-1]
    ran = {test: passed for test, passed in tests.items() if test == name or test.startswith(name + "::")}
    if not ran:
        missing.append(name)
        return "did not run"
    passed = sum(ran.values())
    told = [f"{passed} of {len(ran)} pass"] if passed < len(ran) else [f"{passed} pass"]
    return "; ".join(told + figures.get(module, []))


rows = []
for line in ledger.read_text(encoding="utf-8").splitlines():
    cells = [cell.strip() for cell in line.strip().strip("|").split(" | ")]
    named = re.fullmatch(r"`([\w:-]+)`", cells[3]) if line.startswith("|") and len(cells) == 5 else None
    rows.append(f"| {' | '.join(cells[:4])} | {night_of(named[1])} |" if named else line)
ledger.write_text("\n".join(rows) + "\n", encoding="utf-8")
print(f"{len(tests)} tests, {sum(not passed for passed in tests.values())} failed, {sum(map(len, figures.values()))} figures")
if missing:
    sys.exit(f"no test of {', '.join(missing)} ran")
