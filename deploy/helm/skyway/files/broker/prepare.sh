#!/bin/sh
# Copies the broker's files to where the registry adds the accounts; only this user can read them.
set -eu
umask 077
folder=/var/lib/skyway/broker
cp -f /etc/skyway-broker/mosquitto.conf /etc/skyway-broker/service_acl "$folder/"
cp -f /etc/skyway-broker-tls/ca.pem /etc/skyway-broker-tls/server.pem \
    /etc/skyway-broker-tls/server-key.pem "$folder/"
for file in passwords service_passwords client_acl; do
    [ -e "$folder/$file" ] || : > "$folder/$file"
done
