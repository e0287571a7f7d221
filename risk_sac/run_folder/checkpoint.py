"""Checkpoints of a run.

A checkpoint is a `torch.save` archive that `weights_only=True` reads, so it can run no code, followed by its
SHA-256. The last but one is kept beside it, for the case that the last one is damaged.
"""

import errno
import hashlib
import io
import logging
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import torch

from risk_sac.errors import CheckpointError, DamagedCheckpoint
from risk_sac.run_folder.durable import replace_file, set_aside

logger = logging.getLogger(__name__)

State = dict[str, Any]
"""Nested dicts, lists and tuples of tensors, arrays, None, bool, int (of any size), float, str and bytes."""

_ARRAY = "__ndarray__"  # weights_only knows tensors but no arrays: {_ARRAY: tensor} stands for one
_PLAIN = (type(None), bool, int, float, str, bytes)
_DIGEST_BYTES = hashlib.sha256().digest_size


def save(path: Path, state: State, run_digest: str) -> None:
    """Replaces the checkpoint at `path` and keeps the one before it.

    A crash at any moment leaves a good one.

    One writer per path. Tensors are stored as they are on the CPU, views without the storage they look into.

    Raises:
        OSError: the folder is missing, unwritable or full; an old checkpoint stays as it was.
        TypeError: the state holds something `load` could not read back; the message says where.
    """
    archive = io.BytesIO()
    torch.save({"run_digest": run_digest, "state": _encode(state, "state")}, archive)
    archive.write(hashlib.sha256(archive.getbuffer()).digest())
    replace_file(path, archive.getbuffer(), keep=previous(path))


def previous(path: Path) -> Path:
    """Returns the path of the checkpoint before the one at `path`."""
    return path.with_name(f"{path.name}.previous")


def exists(path: Path) -> bool:
    """Whether there is a checkpoint, good or not."""
    return path.exists() or previous(path).exists()


def load_newest(path: Path, run_digest: str) -> State | None:
    """Loads the newer of the two checkpoints that is undamaged.

    Returns None if neither is: a run can always restart. A damaged one is renamed, so that it never replaces a good
    one.

    Raises:
        CheckpointError: it belongs to another run.
        OSError: one exists but cannot be read.
    """
    for candidate in (path, previous(path)):
        if not candidate.exists():
            continue
        try:
            return load(candidate, run_digest)
        except DamagedCheckpoint as error:
            logger.warning("%s; it is kept as %s, and the run falls back", error, set_aside(candidate).name)
        except OSError as error:
            if error.errno != errno.EIO:  # a sector that cannot be read will not be readable later
                raise
            logger.warning("checkpoint %s cannot be read (%s); the run falls back", candidate, error.strerror)
    return None


def load(path: Path, run_digest: str) -> State:
    """Reads a checkpoint, tensors on the CPU.

    Raises:
        DamagedCheckpoint: its bytes are not those that were written, or something else wrote it.
        CheckpointError: it is missing, or belongs to another run.
        OSError: it exists but cannot be read.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise CheckpointError(f"there is no checkpoint at {path}; start the run from its first episode") from error
    archive, digest = content[:-_DIGEST_BYTES], content[-_DIGEST_BYTES:]
    if hashlib.sha256(archive).digest() != digest:
        raise DamagedCheckpoint(
            f"checkpoint {path} is damaged or cut short, or an earlier version wrote it: "
            f"its {len(content)} bytes do not end in the SHA-256 of those before"
        )
    try:
        stored = torch.load(io.BytesIO(archive), map_location="cpu", weights_only=True)
        owner, state = stored["run_digest"], stored["state"]
    except (pickle.UnpicklingError, RuntimeError, EOFError, KeyError, TypeError) as error:
        raise CheckpointError(
            f"checkpoint {path} is undamaged but holds something else than a run's state; delete it"
        ) from error
    if owner != run_digest:
        raise CheckpointError(
            f"checkpoint {path} belongs to the run {owner}; wanted {run_digest}. Its specification has changed since: "
            "give the new run another folder"
        )
    decoded: State = _decode(state)
    return decoded


def _encode(value: object, where: str) -> object:
    """The same tree without arrays, on the CPU and free of autograd; `where` names the spot in errors."""
    if type(value) in _PLAIN:  # exact: a subclass such as numpy.float64 or an enum would not load
        return value
    if isinstance(value, torch.Tensor):
        tensor = value.detach().cpu()
        return tensor if tensor.untyped_storage().nbytes() == tensor.nbytes else tensor.clone()
    if isinstance(value, np.ndarray):
        return {_ARRAY: _tensor_of(value, where)}
    if isinstance(value, list | tuple) and type(value) in (list, tuple):  # a named tuple would come back as a tuple
        items = [_encode(item, f"{where}[{index}]") for index, item in enumerate(value)]
        return items if isinstance(value, list) else tuple(items)
    if isinstance(value, dict):
        if not all(type(key) in (str, int) and key != _ARRAY for key in value):
            raise TypeError(f"{where} has keys {list(value)}; wanted str or int, none of them {_ARRAY!r}")
        return {key: _encode(item, f"{where}[{key!r}]") for key, item in value.items()}
    raise TypeError(f"{where} is a {type(value).__name__}; a checkpoint holds tensors, arrays and plain values only")


def _tensor_of(array: np.ndarray[Any, Any], where: str) -> torch.Tensor:
    own = array if array.flags.c_contiguous and array.flags.writeable else array.copy(order="C")
    try:
        return torch.from_numpy(own)
    except TypeError as error:
        raise TypeError(f"{where} is an array of {array.dtype}; wanted numbers or bool") from error


def _decode(value: Any) -> Any:
    if isinstance(value, dict):
        if _ARRAY in value:
            return value[_ARRAY].numpy()
        return {key: _decode(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(_decode(item) for item in value)
    return value
