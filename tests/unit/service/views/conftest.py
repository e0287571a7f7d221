import pytest


@pytest.fixture
def database_url(tmp_path):
    """Returns a SQLite URL: views do not depend on the database."""
    return f"sqlite:///{tmp_path}/test.db"
