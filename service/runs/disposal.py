"""Removing a campaign's folder together with its rows, whole or not at all, whenever the server dies.

The folder is first renamed, then the rows go, then the renamed folder: what a server that died in between left
behind says by its name how far it was.
"""

import logging
import shutil
from collections.abc import Callable
from pathlib import Path

logger = logging.getLogger(__name__)

PREFIX = ".deleted-"


def dispose(folder: Path, forget: Callable[[], None]) -> None:
    """Remove a folder, which may be missing, and what the database knows of it.

    Args:
      folder: of the campaign.
      forget: removes the rows; where it raises, the folder stays.

    Raises:
      OSError: the folder cannot be renamed or removed.
    """
    grave = folder.with_name(f"{PREFIX}{folder.name}")
    if folder.exists():
        folder.rename(grave)
    try:
        forget()
    except BaseException:
        if grave.exists():
            grave.rename(folder)
        raise
    if grave.exists():
        shutil.rmtree(grave)


def settle(campaigns: Path, exists: Callable[[str], bool]) -> None:
    """Finish, or take back, what an earlier server had begun to remove.

    Args:
      campaigns: the folder of all campaigns' folders.
      exists: whether the database has a campaign with this id.

    Raises:
      OSError: the folder cannot be written.
    """
    for folder in sorted(campaigns.glob("*")):
        name = folder.name.removeprefix(PREFIX)
        if exists(name):
            if folder.name != name:
                folder.rename(folder.with_name(name))
        elif folder.name != name:
            shutil.rmtree(folder)
        else:
            logger.warning("folder %s belongs to no campaign of the database; it is left alone", folder)
