"""Values with which the chart is rendered, and values that it refuses."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import yaml

#: Values are JSON of every kind.
Values = Mapping[str, Any]

_PAGE: Final = Path(__file__).parents[2] / "docs/kubernetes.md"


def _of_page() -> Values:
    """The values that docs/kubernetes.md shows first."""
    block = _PAGE.read_text().partition("```yaml\n")[2].partition("```")[0]
    values: Values = yaml.safe_load(block)
    return values


_SCALED: Final = {"enabled": True, "minReplicas": 3, "maxReplicas": 9, "queueDepth": 20}

#: Every option that adds something.
EVERYTHING: Final[Values] = {
    "fullnameOverride": "sky",
    "image": {"repository": "images.example.org/skyway", "tag": "0.1.0-rc1"},
    "imagePullSecrets": ["login"],
    "database": {"host": "db.example.org", "sslMode": "verify-full", "caSecret": "database-ca"},
    "gateway": {
        "settings": {
            "SKYWAY_HTTP_CONNECTIONS": 1_000_000,
            "SKYWAY_HOLD_S": 30.5,
            "SKYWAY_TRUSTED_PROXIES": "10.244.0.0/16",
        },
        "autoscaling": _SCALED,
        "nodeSelector": {"disk": "fast"},
        "tolerations": [{"key": "cloud", "operator": "Exists"}],
        "affinity": {"podAntiAffinity": {}},
        "priorityClassName": "high",
        "podAnnotations": {"team": "drones"},
    },
    "composition": {"autoscaling": _SCALED, "podAnnotations": {"team": "drones"}},
    "registry": {"settings": {"SKYWAY_TELEMETRY_DAYS": 60}, "podAnnotations": {"team": "drones"}},
    "broker": {
        "drones": {
            "enabled": True,
            "annotations": {"load-balancer": "internal"},
            "sourceRanges": ["198.51.100.0/24"],
        }
    },
    "agents": {"enabled": True, "scenario": "windy", "storage": {"className": "fast"}},
    "ingress": {
        "enabled": True,
        "className": "nginx",
        "annotations": {"nginx.ingress.kubernetes.io/proxy-buffering": "off"},
        "host": "skyway.example.org",
        "tlsSecret": "skyway-tls",
    },
    "networkPolicy": {
        "callers": [],
        "monitoring": [{"namespaceSelector": {"matchLabels": {"name": "monitoring"}}}],
        "database": [{"ipBlock": {"cidr": "10.1.0.0/16"}}],
        "extraEgress": [{"ports": [{"protocol": "TCP", "port": 4318}]}],
    },
    "monitoring": {
        "serviceMonitor": {"enabled": True, "labels": {"release": "prometheus"}},
        "prometheusRule": {"enabled": True, "labels": {"release": "prometheus"}},
    },
}

CASES: Final[Mapping[str, Values]] = {
    "default": {},
    "everything": EVERYTHING,
    "outside broker": {
        "broker": {
            "mode": "outside",
            "outside": {"host": "mqtt.example.org", "tls": True, "accountsClaim": "accounts"},
        },
        "agents": {"enabled": True, "networkId": ""},
        "networkPolicy": {"callers": [], "broker": [{"ipBlock": {"cidr": "10.2.0.0/16"}}]},
    },
    "clusters": {
        "database": {"host": "db-1.example.org,db-2.example.org", "sslMode": "prefer"},
        "broker": {
            "mode": "outside",
            "outside": {
                "kind": "nats",
                "host": "node-a.example.org,node-b.example.org",
                "port": 8883,
                "dronePort": 8883,
                "tls": True,
                "accountsClaim": "accounts",
            },
        },
        "registry": {
            "settings": {"SKYWAY_MQTT_DRONE_URL": "mqtts+nats://a.example.org:8883"},
        },
        "agents": {"enabled": True},
    },
    "cells": {
        "cells": [
            {"name": "texas", "networks": ["texas-corridor"]},
            {
                "name": "north",
                "networks": ["north-1", "north-2"],
                "replicas": 3,
                "databaseHost": "db-north.example.org",
                "secret": "north-secrets",
            },
        ],
        "monitoring": {"serviceMonitor": {"enabled": True}},
    },
    "page": _of_page(),
    "bare": {"networkPolicy": {"enabled": False}},
}

#: Wrong values, by words that their error has to say (without quotes).
WRONG: Final[Mapping[str, Values]] = {
    "gatway not allowed": {"gatway": {}},
    "/gateway/replicas: minimum": {"gateway": {"replicas": 0}},
    "SKYWAY_BOOKINGS not allowed": {"gateway": {"settings": {"SKYWAY_BOOKINGS": 8}}},
    "SKYWAY_BOOKINGS_AT_ONCE: maximum": {"gateway": {"settings": {"SKYWAY_BOOKINGS_AT_ONCE": 65}}},
    "SKYWAY_DATABASE_URL not allowed": {
        "registry": {"settings": {"SKYWAY_DATABASE_URL": "sqlite:///a.db"}}
    },
    "/database/port: got string": {"database": {"port": "5432"}},
    "/database/caSecret: minLength": {"database": {"caSecret": ""}},
    "SKYWAY_TRUSTED_PROXIES is needed with the ingress": {
        "ingress": {"enabled": True, "host": "skyway.example.org", "tlsSecret": "skyway-tls"}
    },
    "/database/host: db-1, db-2 does not match": {"database": {"host": "db-1, db-2"}},
    "/broker/outside/kind: value must be one of": {"broker": {"outside": {"kind": "rabbit"}}},
    "/broker/mode: value must be one of": {"broker": {"mode": "embedded"}},
    "/broker/outside/accountsClaim: minLength": {
        "broker": {"mode": "outside", "outside": {"host": "mqtt.example.org"}}
    },
    "/ingress/tlsSecret: minLength": {"ingress": {"enabled": True, "host": "skyway.example.org"}},
    "/gateway/resources/limits/memory: 1 GB does not match": {
        "gateway": {"resources": {"limits": {"memory": "1 GB"}}}
    },
    "/agents/drones: maximum": {"agents": {"drones": 5_001}},
    "/secrets/gateway: A secret does not match": {"secrets": {"gateway": "A secret"}},
    "SKYWAY_CELLS not allowed": {"gateway": {"settings": {"SKYWAY_CELLS": "ohio=http://ohio"}}},
    "SKYWAY_CELL_URL not allowed": {
        "composition": {"settings": {"SKYWAY_CELL_URL": "http://composition"}}
    },
    "/cells/0: missing property networks": {"cells": [{"name": "texas"}]},
    "/cells/0/name: Texas does not match": {"cells": [{"name": "Texas", "networks": ["t"]}]},
    "/cells/0: missing property secret": {
        "cells": [{"name": "t", "networks": ["t"], "databaseHost": "db.example.org"}]
    },
    "cells: ohio is there twice": {
        "cells": [{"name": "a", "networks": ["ohio"]}, {"name": "b", "networks": ["ohio"]}]
    },
    "choose a shorter one": {
        "fullnameOverride": "a-name-of-forty-characters-for-the-chart",
        "cells": [{"name": "a-long-name", "networks": ["ohio"]}],
    },
    "minReplicas 9 is above maxReplicas 6": {
        "composition": {"autoscaling": {"enabled": True, "minReplicas": 9}}
    },
}
