#!/usr/bin/env bash
# {{shards}} processes on this machine, then the tables. Stop and repeat at will.
set -eu
{{plan}}
for i in $(seq 0 {{last}}); do
  {{run}} --shard "$i/{{shards}}" -j {{cpus}} --no-progress &
done
wait
{{merge}}
