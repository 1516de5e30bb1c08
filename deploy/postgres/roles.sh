#!/bin/sh
# Runs once, on an empty PostgreSQL: one role and one database per service, nothing shared.
set -eu
for service in registry composition gateway; do
    password=$(cat "/var/lib/postgres-passwords/$service")
    psql --username=postgres --set=ON_ERROR_STOP=1 --set=name="skyway_$service" --set=password="$password" <<'SQL'
CREATE ROLE :"name" LOGIN PASSWORD :'password';
CREATE DATABASE :"name" OWNER :"name";
REVOKE CONNECT ON DATABASE :"name" FROM PUBLIC;
SQL
done
