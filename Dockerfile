# One image for every process of Skyway; docker-compose.yml says which one a container runs.
FROM python:3.11-slim AS build
WORKDIR /src
COPY requirements-image.txt pyproject.toml README.md LICENSE ./
RUN python -m venv /opt/skyway \
    && /opt/skyway/bin/pip install --no-cache-dir --require-hashes -r requirements-image.txt
COPY skyway skyway
COPY gateway gateway
COPY services services
RUN /opt/skyway/bin/pip install --no-cache-dir --no-deps --no-build-isolation .

FROM python:3.11-slim
RUN useradd --uid 10001 --home-dir /var/lib/skyway --create-home skyway \
    && install --directory --owner=skyway /var/lib/postgres-passwords /var/cache/skyway \
        /var/lib/skyway/broker /var/lib/skyway/drone-ca /var/lib/secrets/registry \
        /var/lib/secrets/composition /var/lib/secrets/gateway /var/lib/secrets/commands
COPY --from=build /opt/skyway /opt/skyway
ENV PATH=/opt/skyway/bin:$PATH PYTHONUNBUFFERED=1 SKYWAY_DATA=/var/lib/skyway \
    NUMBA_CACHE_DIR=/var/cache/skyway NUMBA_CPU_NAME=x86-64-v3 NUMBA_CPU_FEATURES=
USER skyway
# Compiled for this processor; on another one composition compiles again before it is ready.
RUN python -m skyway.planner.warm && python -m skyway.dispatch.warm
VOLUME /var/lib/skyway
CMD ["skyway", "doctor"]
