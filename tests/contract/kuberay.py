"""What KubeRay's operator takes for a RayCluster, as far as `docker/kuberay.yaml` uses it.

After the definition of `rayclusters.ray.io`, version v1, in ray-project/kuberay (helm-chart/kuberay-operator/crds):
names, types, and what is required there, of the older versions too, which want `rayStartParams`. As with `kubectl`'s
strict validation a field that is not listed is an error, which here may also mean that nobody has looked it up yet.
"""

from typing import Any

Schema = dict[str, Any]


def _object(*required: str, **properties: Schema) -> Schema:
    return {"type": "object", "required": required, "properties": properties, "additionalProperties": False}


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items}


def _map(values: Schema) -> Schema:
    return {"type": "object", "additionalProperties": values}


TEXT, WHOLE, YES = {"type": "string"}, {"type": "integer"}, {"type": "boolean"}
# Kubernetes' quantity: a number, and what it is counted in.
QUANTITY = {
    "anyOf": [WHOLE, {"type": "string", "pattern": r"^[+-]?(\d+(\.\d*)?|\.\d+)([KMGTPE]i|[numkMGTPE]|[eE][+-]?\d+)?$"}]
}
SECRET = _object(name=TEXT, optional=YES)
SECRET_KEY = _object("key", key=TEXT, name=TEXT, optional=YES)
CONTAINER = _object(
    "name",
    name=TEXT,
    image=TEXT,
    imagePullPolicy=TEXT,
    ports=_list(_object("containerPort", containerPort=WHOLE, name=TEXT, protocol=TEXT)),
    env=_list(_object("name", name=TEXT, value=TEXT, valueFrom=_object(secretKeyRef=SECRET_KEY))),
    envFrom=_list(_object(prefix=TEXT, secretRef=SECRET)),
    resources=_object(limits=_map(QUANTITY), requests=_map(QUANTITY)),
    volumeMounts=_list(_object("mountPath", "name", mountPath=TEXT, name=TEXT, readOnly=YES, subPath=TEXT)),
)
POD = _object(
    metadata=_object(annotations=_map(TEXT), labels=_map(TEXT), name=TEXT, namespace=TEXT),
    spec=_object("containers", containers=_list(CONTAINER) | {"minItems": 1}, terminationGracePeriodSeconds=WHOLE),
)
HEAD = _object("rayStartParams", "template", rayStartParams=_map(TEXT), serviceType=TEXT, template=POD)
GROUP = _object(
    "groupName",
    "maxReplicas",
    "minReplicas",
    "rayStartParams",
    "template",
    groupName=TEXT,
    maxReplicas=WHOLE,
    minReplicas=WHOLE,
    rayStartParams=_map(TEXT),
    replicas=WHOLE,
    template=POD,
)
RAY_CLUSTER = _object(
    "apiVersion",
    "kind",
    "metadata",
    "spec",
    apiVersion={"const": "ray.io/v1"},
    kind={"const": "RayCluster"},
    metadata=_object("name", name=TEXT),
    spec=_object(
        "headGroupSpec",
        enableInTreeAutoscaling=YES,
        headGroupSpec=HEAD,
        rayVersion=TEXT,
        workerGroupSpecs=_list(GROUP),
    ),
)
