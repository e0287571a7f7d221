"""Egos in their own processes, by `ego.proto`; needs the extra `remote`."""
