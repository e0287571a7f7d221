import pytest

from risk_sac.client import Client
from tests.unit.client.scripted_server import Server


@pytest.fixture
def server():
    with Server() as server:
        yield server
        server.shutdown()


@pytest.fixture
def client(server):
    with Client(server.url, timeout_s=5, patience_s=2) as client:
        yield client
