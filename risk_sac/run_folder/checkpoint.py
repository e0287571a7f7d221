"""Checkpoints of a run.

A checkpoint is an .npz without pickles, so it can run no code, followed by its SHA-256: the arrays and tensors of the
state, and the rest of it as JSON. So a search without a learner needs no torch. The last but one is kept beside it,
for the case that the last one is damaged.
"""

import errno
import hashlib
import io
import json
import logging
import pickle
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from risk_sac.errors import CheckpointError, DamagedCheckpoint
from risk_sac.run_folder.durable import replace_file, set_aside

logger = logging.getLogger(__name__)

State = dict[str, Any]
"""Nested dicts, lists and tuples of tensors, arrays, None, bool, int (of any size), float, str and bytes."""

_ARRAY = "__ndarray__"  # in a checkpoint of an earlier version, {_ARRAY: tensor} stands for an array
_TREE, _KIND = "tree", "__kind__"
_PLAIN = (type(None), bool, int, float, str)
_DIGEST_BYTES = hashlib.sha256().digest_size


def save(path: Path, state: State, run_digest: str) -> None:
    """Replaces the checkpoint at `path` and keeps the one before it.

    A crash at any moment leaves a good one.

    One writer per path. Tensors come back on the CPU, views without the storage they look into.

    Raises:
        OSError: the folder is missing, unwritable or full; an old checkpoint stays as it was.
        TypeError: the state holds something `load` could not read back; the message says where.
    """
    archive, arrays = io.BytesIO(), list[np.ndarray[Any, Any]]()
    tree = json.dumps({"run_digest": run_digest, "state": _encode(state, "state", arrays)})
    np.savez(archive, *arrays, allow_pickle=False, **{_TREE: np.frombuffer(tree.encode(), dtype=np.uint8)})
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
        owner, state = _load(archive) if _is_ours(archive) else _load_torch(archive)
    except (pickle.UnpicklingError, RuntimeError, EOFError, KeyError, TypeError, ValueError) as error:
        raise CheckpointError(
            f"checkpoint {path} is undamaged but holds something else than a run's state; delete it"
        ) from error
    if owner != run_digest:
        raise CheckpointError(
            f"checkpoint {path} belongs to the run {owner}; wanted {run_digest}. Its specification has changed since: "
            "give the new run another folder"
        )
    return state


def _is_ours(archive: bytes) -> bool:
    try:
        return f"{_TREE}.npy" in zipfile.ZipFile(io.BytesIO(archive)).namelist()
    except zipfile.BadZipFile:
        return False


def _load(archive: bytes) -> tuple[str, State]:
    with np.load(io.BytesIO(archive), allow_pickle=False) as arrays:
        tree = json.loads(arrays[_TREE].tobytes())
        return tree["run_digest"], _decode(tree["state"], arrays)


def _encode(value: object, where: str, arrays: list[np.ndarray[Any, Any]]) -> object:
    """Returns a JSON tree with indices into `arrays`; errors name `where`."""
    if type(value) in _PLAIN:  # exact: a subclass such as numpy.float64 or an enum would come back as another type
        return value
    if isinstance(value, bytes):
        return {_KIND: "bytes", "hex": value.hex()}
    kind, array = "array", value
    if _is_tensor(value):
        kind, array = "tensor", value.detach().cpu().numpy()  # type: ignore[attr-defined]
    if isinstance(array, np.ndarray):
        if array.dtype.kind not in "fiub":
            raise TypeError(f"{where} is an array of {array.dtype}; wanted numbers or bool")
        arrays.append(array)
        return {_KIND: kind, "number": len(arrays) - 1}
    if isinstance(value, list | tuple) and type(value) in (list, tuple):  # a named tuple would come back as a tuple
        items = [_encode(item, f"{where}[{index}]", arrays) for index, item in enumerate(value)]
        return items if isinstance(value, list) else {_KIND: "tuple", "items": items}
    if isinstance(value, dict):
        if not all(type(key) in (str, int) for key in value):
            raise TypeError(f"{where} has keys {list(value)}; wanted str or int")
        pairs = {key: _encode(item, f"{where}[{key!r}]", arrays) for key, item in value.items()}
        plain = _KIND not in pairs and all(isinstance(key, str) for key in pairs)
        return pairs if plain else {_KIND: "dict", "items": [*map(list, pairs.items())]}
    raise TypeError(f"{where} is a {type(value).__name__}; a checkpoint holds tensors, arrays and plain values only")


def _is_tensor(value: object) -> bool:
    torch = sys.modules.get("torch")  # without it there are none, and loading it takes a second
    return torch is not None and isinstance(value, torch.Tensor)


def _decode(value: Any, arrays: Mapping[str, np.ndarray[Any, Any]]) -> Any:
    if isinstance(value, list):
        return [_decode(item, arrays) for item in value]
    if not isinstance(value, dict):
        return value
    kind = value.get(_KIND)
    if kind is None:
        return {key: _decode(item, arrays) for key, item in value.items()}
    if kind == "bytes":
        return bytes.fromhex(value["hex"])
    if kind == "tuple":
        return tuple(_decode(item, arrays) for item in value["items"])
    if kind == "dict":
        return {key: _decode(item, arrays) for key, item in value["items"]}
    array = arrays[f"arr_{value['number']}"]
    if kind == "array":
        return array
    import torch

    return torch.from_numpy(array)


def _load_torch(archive: bytes) -> tuple[str, State]:
    """Reads what earlier versions wrote with `torch.save`."""
    import torch

    stored = torch.load(io.BytesIO(archive), map_location="cpu", weights_only=True)
    return stored["run_digest"], _without_torch_arrays(stored["state"])


def _without_torch_arrays(value: Any) -> Any:
    if isinstance(value, dict):
        if _ARRAY in value:
            return value[_ARRAY].numpy()
        return {key: _without_torch_arrays(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(_without_torch_arrays(item) for item in value)
    return value
