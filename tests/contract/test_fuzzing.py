"""Requests within and outside the API's description; every answer must follow it.

RISK_SAC_SCHEMATHESIS_CASES=20000 tries so many over all routes.
"""

import math
import os
from collections import Counter

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, settings

from service.api.description import GUARDS, openapi
from service.app import create_app
from service.settings import ServiceSettings

CASES = int(os.environ.get("RISK_SAC_SCHEMATHESIS_CASES", "200"))
# A formula or a cursor can be wrong in ways that no JSON schema can say.
ACCEPTANCE = schemathesis.checks.positive_data_acceptance
REJECTION = schemathesis.checks.negative_data_rejection

document = openapi(create_app(ServiceSettings()))
schema = schemathesis.openapi.from_dict(document)
# Those that take nothing can be called in few ways.
operations = [each for methods in document["paths"].values() for each in methods.values()]
varied = sum("parameters" in each or "requestBody" in each for each in operations)
tried = Counter()

limits = settings(
    max_examples=math.ceil(CASES / varied),
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)


@schemathesis.serializer("application/zip", "application/gzip", "application/x-gzip")
def uploaded(context, value):
    return value if isinstance(value, bytes) else str(value).encode("utf-8", "surrogatepass")


class Ended:
    """The id of a campaign that has ended, until it is deleted."""

    def __init__(self, client):
        self._client = client
        self._id = "none"

    def get(self):
        path = f"/v1/campaigns/{self._id}"
        if self._client.get(path).status_code == 404:
            self._id = self._client.post("/v1/campaigns", json={"families": ["low"]}).json()["id"]
            path = f"/v1/campaigns/{self._id}"
            self._client.post(f"{path}/cancel")
            while self._client.get(path).json()["state"] != "cancelled":
                pass
        return self._id


@pytest.fixture(scope="session")
def ended(base_url):
    with httpx.Client(base_url=base_url, timeout=600) as client:
        yield Ended(client)


@pytest.mark.timeout(3600)
@schema.parametrize()
@limits
def test_no_response_contradicts_the_document(case, base_url, ended):
    tried[case.operation.label] += 1
    excluded = [ACCEPTANCE]
    if "campaign_id" in case.path_parameters and tried[case.operation.label] % 2:
        case.path_parameters["campaign_id"] = ended.get()  # or there would be little but 404s
        excluded.append(REJECTION)
    answer = case.call_and_validate(base_url=base_url, excluded_checks=excluded)
    declared = {*case.operation.definition.raw["responses"]} | {str(status) for status in (405, *GUARDS)}
    assert str(answer.status_code) in declared  # of which `default` stands for the guards alone


@pytest.mark.skipif("PYTEST_XDIST_WORKER" in os.environ, reason="each process counts its own cases only")
def test_the_cases_that_were_asked_for_were_tried():
    print(f"{sum(tried.values())} cases: {dict(tried)}")
    assert sum(tried.values()) >= CASES
