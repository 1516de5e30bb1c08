#!/bin/sh
# Runs a node of NATS, and has it read its accounts again whenever the registry writes them.
# start.sh CONFIGURATION ACCOUNTS [NATS-SERVER]
set -eu
configuration=$1
accounts=$2
server=${3:-nats-server}

"$server" -c "$configuration" &
node=$!
trap 'kill -TERM "$node"' TERM INT

seen=$(cksum "$accounts")
while kill -0 "$node" 2>/dev/null; do
    now=$(cksum "$accounts")
    if [ "$now" != "$seen" ]; then
        seen=$now
        kill -HUP "$node"
    fi
    sleep 0.2
done
wait "$node"
