import json
import subprocess
import sys


def test_the_server_process_loads_neither_torch_nor_libsumo_and_matplotlib_only_once_it_draws():
    code = (
        "import json, sys; from service.app import create_app; from service.settings import ServiceSettings;"
        "create_app(ServiceSettings()).openapi(); print(json.dumps(sorted(sys.modules)))"
    )
    loaded = json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)
    assert "service.runs.manager" in loaded
    assert "risk_sac.report" in loaded
    assert not {"torch", "libsumo", "botorch", "gpytorch", "matplotlib", "service.worker"} & set(loaded)
