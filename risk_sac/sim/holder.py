"""The one simulation that libsumo can run in a process, and the object that it runs for."""

import gc
import os
from collections.abc import Sequence
from weakref import ref

import libsumo

from risk_sac.errors import SimulationError


class Holder:
    """Lock that lets one owner at a time use libsumo.

    An owner that was garbage-collected, or that belongs to the parent process, no longer counts.
    """

    def __init__(self) -> None:
        self._owner: ref[object] | None = None
        self._process = 0

    def load(self, owner: object, options: Sequence[str]) -> None:
        """Starts a simulation for an owner, or its next one.

        Raises:
          SimulationError: the process already runs a simulation for something else.
        """
        if libsumo.isLoaded() and self.is_held_by(owner) and self._process == os.getpid():
            libsumo.load(list(options))
            return
        if self._is_taken(owner):
            gc.collect()  # an owner without references may still be part of a cycle
        if self._is_taken(owner):
            raise SimulationError(
                "this process already runs the simulation of another environment, and libsumo can run only one; close "
                "that environment first, or run each in a process of its own, as gymnasium.vector.AsyncVectorEnv does"
            )
        if libsumo.isLoaded():
            libsumo.close()
        self._owner, self._process = ref(owner), os.getpid()
        libsumo.start(["sumo", *options])

    def is_held_by(self, owner: object) -> bool:
        """Whether the latest simulation of this process is the owner's."""
        return self._owner is not None and self._owner() is owner

    def close(self, owner: object) -> None:
        """Ends the simulation if it is the owner's."""
        if self.is_held_by(owner):
            self._owner = None
            if libsumo.isLoaded():
                libsumo.close()

    def _is_taken(self, owner: object) -> bool:
        if self._owner is None:
            return bool(libsumo.isLoaded())  # by code outside this package
        return self._process == os.getpid() and self._owner() not in (None, owner)


LIBSUMO = Holder()
