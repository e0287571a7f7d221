import pytest


@pytest.fixture
def database_url(tmp_path):
    """SQLite alone: views read what the store hands out, whichever database it is in."""
    return f"sqlite:///{tmp_path}/test.db"
