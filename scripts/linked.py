"""The crates that a program is made of, by `cargo metadata` on stdin: not what builds or tests it."""

import json
import sys


def linked():
    """Root, and the foreign packages it is linked from, by name and version; the graph of all by id."""
    metadata = json.load(sys.stdin)
    packages = {p["id"]: p for p in metadata["packages"]}
    nodes = {n["id"]: n for n in metadata["resolve"]["nodes"]}
    root = metadata["resolve"]["root"]
    graph, waiting = {}, [root]
    while waiting:
        node = waiting.pop()
        if node in graph:
            continue
        normal = (d["pkg"] for d in nodes[node]["deps"] if any(kind["kind"] is None for kind in d["dep_kinds"]))
        graph[node] = list(normal)
        waiting += graph[node]
    found = sorted((packages[i] for i in graph if packages[i]["source"]), key=lambda p: (p["name"], p["version"]))
    return packages[root], found, {packages[i]["id"]: graph[i] for i in graph}
