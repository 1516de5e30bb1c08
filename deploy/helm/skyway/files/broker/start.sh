#!/bin/sh
# Runs Mosquitto in a container, and has it read its accounts again whenever the registry writes them.
set -eu
# The registry writes this file last, after those of the services and of the operators' rights.
passwords="$SKYWAY_BROKER_FOLDER/passwords"

mosquitto -c "$SKYWAY_BROKER_FOLDER/mosquitto.conf" &
broker=$!
trap 'kill -TERM "$broker"' TERM INT

seen=$(cksum "$passwords")
while kill -0 "$broker" 2>/dev/null; do
    now=$(cksum "$passwords")
    if [ "$now" != "$seen" ]; then
        seen=$now
        kill -HUP "$broker"
    fi
    sleep 0.2
done
wait "$broker"
