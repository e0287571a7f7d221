"""Egos in their own processes, by the protocol `ego.proto`; extra `remote`."""
