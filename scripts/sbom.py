"""A bill of materials (CycloneDX 1.5) of what a program is linked from, from `cargo metadata` on stdin."""

import json

from linked import linked

root, foreign, graph = linked()


def name(package):
    return f"{package['name']}@{package['version']}"


def component(package, kind):
    own = {"type": kind, "bom-ref": name(package), "name": package["name"], "version": package["version"]}
    if package["source"]:
        own["purl"] = f"pkg:cargo/{name(package)}"
    if package["license"]:
        own["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    return own


refs = {p["id"]: name(p) for p in [root, *foreign]}


def reached(node):
    """Foreign crates that a crate is linked from, through the workspace's own."""
    found = set()
    for below in graph[node]:
        found |= {refs[below]} if below in refs else reached(below)
    return found


print(
    json.dumps(
        {
            "bomFormat": "CycloneDX",
            "specVersion": "1.5",
            "version": 1,
            "metadata": {"component": component(root, "application")},
            "components": [component(p, "library") for p in foreign],
            "dependencies": [{"ref": refs[i], "dependsOn": sorted(reached(i))} for i in sorted(refs, key=refs.get)],
        },
        indent=1,
        ensure_ascii=False,
    )
)
