#!/bin/sh
# Runs Mosquitto in a container, and has it read its accounts again whenever the registry writes them.
set -eu
passwords="$SKYWAY_BROKER_FOLDER/passwords"
# The registry writes it before the passwords. An empty list would let in what it has revoked.
revoked="$SKYWAY_BROKER_FOLDER/revoked.pem"
while [ ! -e "$revoked" ]; do sleep 0.2; done

mosquitto -c "$SKYWAY_BROKER_FOLDER/mosquitto.conf" &
broker=$!
trap 'kill -TERM "$broker"' TERM INT

seen=$(cksum "$passwords" "$revoked")
while kill -0 "$broker" 2>/dev/null; do
    now=$(cksum "$passwords" "$revoked")
    if [ "$now" != "$seen" ]; then
        seen=$now
        kill -HUP "$broker"
    fi
    sleep 0.2
done
wait "$broker"
