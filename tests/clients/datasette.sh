#!/usr/bin/env bash
# Opens an export with Datasette and checks that its JSON queries return the numbers that the server returns.
#
#   tests/clients/datasette.sh [BASE]
#
# BASE is the address of a running server, such as http://127.0.0.1:8080, and FRETWORK_TEST_DATA is its data directory.
# Without BASE, the script starts a server.
set -euo pipefail
cd "$(dirname "$0")/../.."

work=target/clients
program=$(tests/program)
scratch=$(mktemp -d)
started=()
trap 'for one in "${started[@]}"; do kill "$one" 2>/dev/null || true; wait "$one" || true; done; rm -rf "$scratch"' EXIT

tests/clients/python

base=${1:-}
data=${FRETWORK_TEST_DATA:-}
if [ -z "$base" ]; then
    data=$scratch/data
    env -i PATH="$PATH" FRETWORK_LOG=warn "$program" --listen 127.0.0.1:0 --data-dir "$data" \
        >"$scratch/said" &
    started+=($!)
    for _ in $(seq 3600); do
        base=$(sed -n 's/^fretwork .* listens on //p' "$scratch/said")
        [ -n "$base" ] && break
        kill -0 "${started[0]}"
        sleep 0.05
    done
fi
for example in steel-ball paper-figure-4 studies/sweep; do
    curl -sSf "$base/v1/jobs" -H 'Content-Type: application/json' -H 'Prefer: wait=60' \
        -d @"examples/$example.json" >"$scratch/${example#studies/}.json"
done
"$program" export "$scratch/results.db" --data-dir "$data"

"$work/bin/datasette" serve "$scratch/results.db" --uds "$scratch/socket" \
    >"$scratch/datasette.log" 2>&1 &
started+=($!)
for _ in $(seq 3600); do
    [ -S "$scratch/socket" ] && break
    kill -0 "${started[-1]}" || { cat "$scratch/datasette.log" >&2; exit 1; }
    sleep 0.05
done

"$work/bin/python" - "$base" "$scratch" <<'PYTHON'
import json, pathlib, sys, urllib.request
import httpx

base, scratch = sys.argv[1], pathlib.Path(sys.argv[2])
client = httpx.Client(transport=httpx.HTTPTransport(uds=str(scratch / "socket")), base_url="http://datasette")

def ask(path, **parameters):
    answer = client.get(path, params={"_shape": "array", **parameters})
    answer.raise_for_status()
    return answer.json()

for example in ("steel-ball", "paper-figure-4"):
    key = json.loads((scratch / f"{example}.json").read_text())["key"]
    body = urllib.request.urlopen(f"{base}/v1/results/{key}").read()
    result = json.loads(body)
    (row,) = ask("/results/results.json", key=key)
    assert row["friction"] == result["scenario"]["friction"]
    assert row["wear_volume"] == result["history"]["wear_volume"][-1]
    assert json.loads(row["scenario"]) == result["scenario"]
    (stored,) = ask("/results/bodies.json", key=key)
    assert stored["body"].encode() == body
    history = ask("/results/history.json", key=key, _size="max", _sort="entry")
    for name, column in result["history"].items():
        assert [entry[name] for entry in history] == column, name
key = json.loads((scratch / "sweep.json").read_text())["key"]
body = urllib.request.urlopen(f"{base}/v1/results/{key}").read()
(row,) = ask("/results/results.json", key=key)
(stored,) = ask("/results/bodies.json", key=key)
assert row["kind"] == "sweep" and json.loads(row["scenario"]) == json.loads(body)["sweep"]
assert stored["body"].encode() == body and ask("/results/history.json", key=key) == []
units = {row["name"]: row["unit"] for row in ask("/results/units.json", _size="max")}
assert units["wear_volume"] == "m^3" and units["friction"] == "1"
found = ask("/results.json", sql="select count(*) as n from results where friction between 0.6 and 0.8")
assert found[0]["n"] >= 1
print("datasette: rows, bodies, history and units of the export equal those of the server")
PYTHON
