"""`service.networks.checker PACKAGING REPORT`: check the file `upload` in the current folder.

Started by `service.networks.sandbox`, which never reads an upload itself. Whatever goes wrong here, by a bug of ours
or of the simulator's, ends this process and nothing else. What passes is written anew beside the upload.
"""

import gc
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path

from service.errors import UploadError
from service.networks import limits
from service.networks.checker.check import check
from service.networks.checker.simulator import bind
from service.networks.report import CheckReport, Packaging

UPLOAD = Path("upload")


def main() -> None:
    """Check the upload and say what came of it."""
    gc.disable()  # no cycles arise, and looking for them takes a sixth of the time
    bind()
    try:
        report = check(UPLOAD, Packaging(sys.argv[1]))
    except UploadError as error:
        report = CheckReport(refused=str(error))
    except MemoryError:
        report = CheckReport(
            refused=f"checking it needs more than {limits.MEMORY_BYTES >> 20} MiB; wanted a smaller network"
        )
    Path(sys.argv[2]).write_text(json.dumps(asdict(report)))
    os._exit(0)  # without the simulator's own clean-up, which may crash


if __name__ == "__main__":
    main()
