"""An export as one file or one folder, whole or not there."""

import io
import shutil
import zipfile
from pathlib import Path

from risk_sac.errors import ConfigError
from risk_sac.failures.export.formats import ZIP, Files, Format
from risk_sac.run_folder.durable import replace_file

BEGINNING = (1980, 1, 1, 0, 0, 0)  # of a zip's calendar: the same export is the same file


def packed(format_: Format, files: Files) -> bytes:
    """What is downloaded: the one file, or a zip of several."""
    if format_.media_type != ZIP:
        (content,) = files.values()
        return content
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, BEGINNING), content, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def write(format_: Format, files: Files, out: Path) -> None:
    """Writes an export into one file, or, where it is several files and `out` names no zip, into a new folder.

    Raises:
      ConfigError: the folder is there and not empty.
      OSError: the disk refuses it; then nothing of it is left.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    if format_.media_type != ZIP or out.suffix == ".zip":
        replace_file(out, packed(format_, files))
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ConfigError("--out", f"{out}, which exists", "a new folder, an empty one, or a name that ends in .zip")
    draft = out.with_name(f".{out.name}.tmp")
    shutil.rmtree(draft, ignore_errors=True)  # of one that was killed
    try:
        draft.mkdir()
        for name, content in files.items():
            replace_file(draft / name, content)
        draft.replace(out)
    except OSError:
        shutil.rmtree(draft, ignore_errors=True)
        raise
