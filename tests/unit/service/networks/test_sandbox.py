import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from risk_sac.maps.convert import FILE_BYTES
from service.errors import StorageError, UploadError
from service.networks import schemas
from service.networks.network_store import inspect
from tests.hostile_networks import NET
from tests.server import LONG_S

BOUND = "import os, sys; from service.networks.checker import bind; bind();"


def python(code: str) -> Sequence[str]:
    return (sys.executable, "-I", "-c", code)


def checker(folder: Path, code: str) -> str:
    """A checker that does what the code says."""
    file = folder / "checker.py"
    file.write_text(code)
    return str(file)


def refusal(folder: Path, code: str, wall_s: float = 60) -> str:
    with pytest.raises(UploadError) as caught:
        inspect(folder, checker(folder, code), wall_s)
    return str(caught.value)


OF_NETEDIT = (
    '<location netOffset="0.00,0.00" convBoundary="0.00,-3.20,100.00,0.00" projParameter="!" '
    'origBoundary="10000000000.00,10000000000.00,-10000000000.00,-10000000000.00"/>'
)


def test_what_sumos_own_editor_writes_is_taken(tmp_path):
    net = NET.replace("<edge", OF_NETEDIT + "<edge", 1).replace('index="0"', 'index="7" acceleration="1" newer="x"')
    net = net.replace("<net", '<net avoidOverlap="0" newer="x"').replace(
        "</edge>", "<param key='a:b' value='1 2'/></edge>"
    )
    (tmp_path / "upload").write_text(f"\ufeff{net}".replace("><", ">\r\n<"), "utf-8")
    assert inspect(tmp_path).warnings == ("there are no traffic lights",)


def test_a_checker_that_crashes_refuses_the_upload(tmp_path):
    assert refusal(tmp_path, "import os; os.kill(os.getpid(), 11)") == (
        "the simulator cannot load it: it was ended by SIGSEGV"
    )
    assert "ended by SIGABRT" in refusal(tmp_path, "import os; os.abort()")


def test_a_checker_that_hangs_is_killed_with_its_children(tmp_path):
    code = (
        "import signal, subprocess, sys, time; signal.signal(signal.SIGTERM, signal.SIG_IGN);"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)']);"
        "open('pid', 'w').write(str(child.pid)); time.sleep(60)"
    )
    began = time.monotonic()
    assert refusal(tmp_path, code, wall_s=5) == "checking the upload takes more than 5 s; wanted a smaller network"
    assert time.monotonic() - began < 30
    pid = int((tmp_path / "pid").read_text())
    for _ in range(600):
        if not Path(f"/proc/{pid}").exists() or "State:\tZ" in Path(f"/proc/{pid}/status").read_text():
            return
        time.sleep(0.05)
    pytest.fail("the child of the checker lives")


def test_a_checker_that_floods_its_output_fills_no_memory(tmp_path):
    code = f"{BOUND} [os.write(1, bytes(1 << 20)) for _ in range(1000)]"
    with pytest.raises(StorageError, match="cannot be checked"):
        inspect(tmp_path, checker(tmp_path, code))
    assert (tmp_path / "log").stat().st_size <= FILE_BYTES


def test_what_the_checker_says_is_not_believed_either(tmp_path):
    for said in ("", "hello", "[]", '{"refused": 3}', '{"summary": {"edges": "many"}}'):
        code = f"import sys; open(sys.argv[1], 'w').write({said!r})"
        with pytest.raises(StorageError, match="cannot be checked"):
            inspect(tmp_path, checker(tmp_path, code))
    with pytest.raises(StorageError, match="cannot be checked"):
        inspect(tmp_path, checker(tmp_path, "raise SystemExit(3)"))


def test_a_checker_that_cannot_be_started_is_no_fault_of_the_upload(tmp_path):
    with pytest.raises(StorageError, match="No such file"):
        inspect(tmp_path / "missing")


def test_the_checker_knows_nothing_of_the_servers_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("RISK_SAC_DATABASE_URL", "postgresql://user:password@host")
    code = "import os; open('environment', 'w').write('\\n'.join(os.environ)); os.abort()"
    refusal(tmp_path, code)
    assert set((tmp_path / "environment").read_text().split()) <= {"PATH", "LC_CTYPE"}  # Python sets the latter


def bounded(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(python(BOUND + code), capture_output=True, text=True, timeout=LONG_S, check=False)


@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("bytearray(checker.MEMORY_BYTES)", "MemoryError"),
        ("[open(os.devnull) for _ in range(schemas.OPEN_FILES)]", "Too many open files"),
        ("open('big', 'wb').truncate(checker.FILE_BYTES + 1)", "File too large"),
    ],
)
def test_the_checker_binds_itself(code, says, tmp_path):
    ended = bounded(f"from service.networks import checker, schemas; os.chdir({str(tmp_path)!r}); {code}")
    assert ended.returncode == 1
    assert says in ended.stderr


def test_the_checker_ends_itself_when_nobody_watches():
    code = f"from service.networks import checker; checker.WALL_S = 1; {BOUND} import time; time.sleep(30)"
    ended = subprocess.run(python(code), timeout=LONG_S, check=False)
    assert ended.returncode == -signal.SIGALRM


def test_the_simulator_may_write_little_whatever_it_is_told(tmp_path):
    # Past our allow-list on purpose: this asks the simulator itself for output, of every vehicle in every step.
    (tmp_path / "net.xml").write_text(NET)
    (tmp_path / "log").touch()
    code = (
        "from service.networks.checker import bind_simulator; import libsumo; os.chdir(sys.argv[1]);"
        "bind_simulator();"
        "libsumo.start(['sumo', '-n', 'net.xml', '--fcd-output', 'out.xml', '--netstate-dump', 'dump.xml']);"
        "[libsumo.simulationStep() for _ in range(20000)]; os._exit(0)"
    )
    subprocess.run([*python(BOUND + code), str(tmp_path)], capture_output=True, timeout=LONG_S, check=False)
    written = [path.stat().st_size for path in tmp_path.glob("*.xml") if path.name != "net.xml"]
    assert max(written) == schemas.LOG_BYTES
