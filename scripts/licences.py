"""Licences of the crates that a binary is made of, from `cargo metadata` on stdin: each with its own texts."""

import json
import pathlib
import sys

metadata = json.load(sys.stdin)
packages = {p["id"]: p for p in metadata["packages"]}
nodes = {n["id"]: n for n in metadata["resolve"]["nodes"]}

# What is linked: normal dependencies of the root, and theirs; not what builds or tests it.
linked, waiting = set(), [metadata["resolve"]["root"]]
while waiting:
    node = waiting.pop()
    if node in linked:
        continue
    linked.add(node)
    for dependency in nodes[node]["deps"]:
        if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
            waiting.append(dependency["pkg"])

foreign = sorted((p for i, p in packages.items() if i in linked and p["source"]), key=lambda p: (p["name"], p["version"]))
for package in foreign:
    print(f"{package['name']} {package['version']}: {package['license'] or 'see its files'}; {package['repository'] or ''}")

# Each text once, under the names of all that have it.
names = ("LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE")
owners = {}
for package in foreign:
    folder = pathlib.Path(package["manifest_path"]).parent
    # also of what a crate carries with it: fonts
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.name.upper().startswith(names):
            text = path.read_text(encoding="utf-8", errors="replace").strip()
            owners.setdefault(text, []).append(f"{package['name']} {package['version']} ({path.relative_to(folder)})")
for text, files in owners.items():
    print(f"\n{'=' * 78}\n{', '.join(files)}\n{'=' * 78}\n{text}")
