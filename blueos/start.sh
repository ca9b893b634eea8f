#!/bin/sh
# The daemon and the operator's page side by side, each started again where it ends. All that is kept is in ASVHIL_DATA.
set -u
data="${ASVHIL_DATA:-/data}"
port="${ASVHIL_PAGE_PORT:-8095}"
config="$data/boat.yaml"
token="$data/page-token"

mkdir -p "$data/runs"
[ -f "$config" ] || printf '# Your boat: what differs from config/blueboat.yaml.\nbase: blueboat\nrecorder:\n  directory: %s/runs\n' "$data" >"$config"
[ -f "$token" ] || (umask 077 && python3 -c 'import secrets; print(secrets.token_urlsafe(16))' >"$token")

keep() {
    trap 'kill -TERM "$child" 2>/dev/null; wait "$child"; exit 0' TERM
    while :; do
        "$@" &
        child=$!
        wait "$child"
        sleep 2 &
        child=$!
        wait "$child"
    done
}

keep asvhil run "$config" &
daemon=$!
keep asvhil dashboard --config "$config" --host 0.0.0.0 --port "$port" --token-file "$token" \
    --allow-host blueos.local --allow-host blueos-wifi.local --allow-origin http://blueos.local &
page=$!
trap 'kill -TERM "$daemon" "$page" 2>/dev/null; wait "$daemon" "$page"; exit 0' TERM INT
wait "$daemon" "$page"
