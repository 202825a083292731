"""Licences of the crates that a binary is made of, from `cargo metadata` on stdin: each with its own texts."""

import pathlib

from linked import linked

_, foreign, _ = linked()
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
