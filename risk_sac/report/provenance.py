"""Where a report was made."""

import platform
from collections.abc import Mapping
from pathlib import Path

_CPU_INFO = Path("/proc/cpuinfo")


def this_platform() -> Mapping[str, str]:
    """Architecture, processor and Python of this machine: what seconds, and the last bits of a digest, depend on."""
    return {"machine": platform.machine(), "cpu": _cpu(), "python": platform.python_version()}


def _cpu() -> str:
    """Python knows no model name on Linux, the kernel does."""
    lines = _CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines() if _CPU_INFO.exists() else []
    names = (
        value.strip() for name, _, value in (line.partition(":") for line in lines) if name.strip() == "model name"
    )
    return next(names, "") or platform.processor() or "unknown"
