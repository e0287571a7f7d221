"""Bundles of failures: packed, checked and unpacked with their scenarios.

A bundled net reaches the simulator only if it has the elements that `risk_sac.maps.finder` writes and no others: SUMO
writes files that a parameter of a signal names, and reads those that XML includes.
"""

import hashlib
import io
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal
from xml.etree.ElementTree import ParseError

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from risk_sac.config import FamilyName, RunSpec
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.failures.recording import Series, actions_of, trajectory_digest
from risk_sac.failures.studied import Core, PlausibleMotion
from risk_sac.records import EpisodeRecord, Record
from risk_sac.run_folder.arrays import MOST_BYTES, read_limited, unpack_arrays
from risk_sac.run_folder.durable import replace_file
from risk_sac.scenario import library
from risk_sac.scenario.reading import shipped_names
from risk_sac.search.frozen_policy import FrozenPolicy
from risk_sac.search.prior.attacker import ACTION_SIZE, INPUT_SIZE
from risk_sac.search.prior.policy import starts_pretrained
from risk_sac.search.scripts import SIZE
from risk_sac.world.types import Scene

SCENARIO = "scenario/"  # names of the arrays with a scenario's files begin so


def carried(family: FamilyName) -> dict[str, NDArray[np.uint8]]:
    """Returns a kept scenario's document and nets as arrays; empty if shipped."""
    if family in shipped_names():
        return {}
    files = library.files_of(family)
    return {f"{SCENARIO}{name}": np.frombuffer(content, dtype=np.uint8) for name, content in files.items()}


def unpack(family: FamilyName, arrays: MutableMapping[str, NDArray[Any]]) -> None:
    """Moves a bundle's scenario into this machine's library; raises `ValueError` if unplayable."""
    names = [name for name in arrays if name.startswith(SCENARIO)]
    files = {name.removeprefix(SCENARIO): arrays.pop(name).tobytes() for name in names}
    if not files or family in shipped_names():
        return
    try:
        library.put(family, files)
    except (ValueError, ParseError) as error:
        raise ValueError(f"the scenario that it carries cannot be played: {error}") from error


PACKAGES = ("libsumo", "numpy")  # packages that decide how an episode goes, given its scene and actions
CODE, WORLD = "risk_sac", "sumo_nets"
MOST_POLICY_BYTES = 2**23
MANIFEST, HEADS, LAYER = "manifest", "signal_heads", "policy_layer_"  # the layers are numbered
RECORDED = "recorded"  # array with the bytes of another bundle's file
NORMALISED = "policy_normalised"  # array that is present if the policy normalises


class Manifest(Record):
    """Description of a bundle's failure."""

    format: Literal[1, 2, 3] = 1  # another one with whatever an older reader would misread
    """2 of those that hold a policy, 3 of those that hold a scenario."""
    id: str
    """The episode's, as the run that found it names it."""
    spec: RunSpec
    episode: EpisodeRecord
    versions: Mapping[str, str]
    """Package → version that it was replayed with when the bundle was made."""
    code: str
    """SHA-256 over the sources."""
    world: Mapping[str, str]
    """File of the road network or of the vehicle types → its SHA-256."""
    digest: str
    """Of the series, see `risk_sac.failures.recording.trajectory_digest`."""
    core: Core | None = None
    """Of what was minimised."""
    plausible: PlausibleMotion | None = None
    """Of the least unlikely motion that fails like a recorded one; that one is kept beside it."""

    @property
    def name(self) -> str:
        """Its id with a digest of what was played: unique across runs."""
        return f"{self.id}-{self.key}"

    @property
    def key(self) -> str:
        """Digest of the run's spec and of the trajectory, eight hexadecimal digits."""
        return hashlib.sha256(f"{self.spec.digest} {self.digest}".encode()).hexdigest()[:8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """A failure that stands alone."""

    manifest: Manifest
    series: Series
    signal_heads: NDArray[np.uint8]  # T since the release x heads, SUMO's letters
    policy: FrozenPolicy | None = None  # of the run; None where it learnt no policy or its policy does not fit
    recorded: "Bundle | None" = None  # what a more plausible motion was searched from


def make_bundle(
    spec: RunSpec,
    episode: EpisodeRecord,
    series: Series,
    signal_heads: NDArray[np.uint8],
    policy: FrozenPolicy | None,
    core: Core | None = None,
) -> Bundle:
    """Bundles a failure just played, without a policy that is too large."""
    if policy is not None and sum(layer.nbytes for layer in policy.layers) > MOST_POLICY_BYTES:
        policy = None
    manifest = Manifest(
        format=3 if spec.family not in shipped_names() else 1 if policy is None else 2,
        id=episode.id_in(spec.id),
        spec=spec,
        episode=episode,
        versions=versions(),
        code=code_digest(),
        world=world_of(spec, episode),
        digest=trajectory_digest(series),
        core=core,
    )
    return Bundle(manifest=manifest, series=series, signal_heads=signal_heads, policy=policy)


def versions() -> dict[str, str]:
    """Returns installed versions of the packages that affect an episode."""
    return {name: version(name) for name in PACKAGES}


def code_digest() -> str:
    """Returns the SHA-256 over the sources of the method."""
    digest = hashlib.sha256()
    for source in sorted(Path(str(files(CODE))).rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()


def world_of(spec: RunSpec, episode: EpisodeRecord) -> dict[str, str]:
    """Returns SHA-256 of SUMO's files for an episode; `ConfigError` if gone."""
    net = Problem.from_spec(spec).family.layout(episode.scene).net
    digests = {}
    for name in (net, "vtypes.add.xml"):
        try:
            content = (Path(str(files(WORLD))) / name).read_bytes()
        except FileNotFoundError as error:
            message = f"{name}, which {episode.id_in(spec.id)} was found on, is gone"
            raise ConfigError("BUNDLE", message) from error
        digests[_portable(name, spec)] = hashlib.sha256(content).hexdigest()
    return digests


def _portable(name: str, spec: RunSpec) -> str:
    """Returns a file's name below `sumo_nets/`, or below the library of places."""
    return f"{spec.family}/{Path(name).name}" if Path(name).is_absolute() else name


def bundle_bytes(bundle: Bundle) -> bytes:
    """Returns the content of a bundle's file; `ConfigError` without its scenario."""
    content = io.BytesIO()
    arrays = {**bundle.series, MANIFEST: np.array(bundle.manifest.model_dump_json()), HEADS: bundle.signal_heads}
    arrays |= carried(bundle.manifest.spec.family)
    if bundle.policy is not None:
        arrays |= {f"{LAYER}{place}": layer for place, layer in enumerate(bundle.policy.layers)}
        if bundle.policy.normalised:
            arrays[NORMALISED] = np.array(True)
    if bundle.recorded is not None:
        arrays[RECORDED] = np.frombuffer(bundle_bytes(bundle.recorded), dtype=np.uint8)
    np.savez_compressed(content, allow_pickle=False, **arrays)
    return content.getvalue()


def check_world(manifest: Manifest) -> None:
    """Raises a `ConfigError` if net or vehicle types differ from the failure's."""
    for name, digest in world_of(manifest.spec, manifest.episode).items():
        if manifest.world.get(name) != digest:
            raise ConfigError("BUNDLE", f"{manifest.id} was found on another {name}, so it cannot be replayed")


def write_bundle(file: Path, bundle: Bundle) -> None:
    """Writes the whole file, or none."""
    file.parent.mkdir(parents=True, exist_ok=True)
    replace_file(file, bundle_bytes(bundle))


def read_bundle(file: Path) -> Bundle:
    """Reads a file that may come from anywhere.

    Raises:
      ConfigError: it is no bundle, of another version, damaged, too large, or holds no episode that can be played.
      OSError: it cannot be read, or the place that it carries cannot be kept.
    """
    content = read_limited(file)
    try:
        return _bundle(content)
    except OSError:
        raise
    except ValidationError as error:
        first = error.errors()[0]
        why = f"a manifest of another version, or none: {'.'.join(map(str, first['loc']))}: {first['msg']}"
        raise ConfigError("BUNDLE", f"{file} is no bundle that can be played: {why}") from error
    except Exception as error:  # what is raised of a series and a policy that mean nothing is an open set
        raise ConfigError("BUNDLE", f"{file} is no bundle that can be played: {error}") from error


def _bundle(content: bytes, *, inner: bool = False) -> Bundle:
    arrays = unpack_arrays(content, most_values=MOST_BYTES)  # of which a place's net has one for each letter
    if missing := {MANIFEST, HEADS} - arrays.keys():
        raise ValueError(f"it lacks {', '.join(missing)}")
    manifest = Manifest.model_validate_json(str(arrays.pop(MANIFEST)))
    heads, recorded = arrays.pop(HEADS), arrays.pop(RECORDED, None)
    if recorded is not None and inner:
        raise ValueError("the bundle that it keeps keeps another one")
    normalised = arrays.pop(NORMALISED, None) is not None
    layers = tuple(arrays.pop(f"{LAYER}{place}") for place in range(sum(name.startswith(LAYER) for name in arrays)))
    unpack(manifest.spec.family, arrays)
    if trajectory_digest(arrays) != manifest.digest:
        raise ValueError("it is damaged: its arrays do not have the digest in its manifest")
    problem = Problem.from_spec(manifest.spec)
    _check_playable(problem, manifest, arrays)
    policy = None
    if layers:
        sizes = problem.observation_size, problem.action_size
        seen, acted = (INPUT_SIZE, ACTION_SIZE) if starts_pretrained(manifest.spec, problem) else sizes
        policy = FrozenPolicy(layers, acted, normalised)
        policy.check(seen)
    kept = None if recorded is None else _bundle(recorded.tobytes(), inner=True)
    return Bundle(manifest=manifest, series=arrays, signal_heads=heads, policy=policy, recorded=kept)


def _check_playable(problem: Problem, manifest: Manifest, series: Series) -> None:
    """Refuses what no run could have recorded, before the simulator reads it."""
    episode = manifest.episode
    problem.space.check(Scene(problem.family.name, episode.scene))
    if episode.seed < 0:
        raise ValueError(f"seed {episode.seed}")
    genes = SIZE * len(problem.family.adversaries)
    if episode.script is not None and (len(episode.script) != genes or not all(0 <= g <= 1 for g in episode.script)):
        raise ValueError(f"a script of {len(episode.script)} genes; wanted {genes} in [0, 1]")
    for name in ("time_s", "released_s", "actions"):
        if name not in series or series[name].dtype.kind != "f":
            raise ValueError(f"{name} is missing, or holds no numbers")
    if series["time_s"].ndim != 1 or series["released_s"].ndim != 0 or series["actions"].ndim != 2:
        raise ValueError("times and actions of other dimensions")
    actions = actions_of(series)
    most, size = problem.family.horizon_steps, problem.action_size
    if not 0 < len(actions) <= most or actions.shape[1] != size or not np.isfinite(actions).all():
        raise ValueError(f"actions of shape {actions.shape}; wanted up to {most} x {size} finite numbers")
