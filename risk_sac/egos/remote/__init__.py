"""Egos in processes of their own, which speak the protocol of `ego.proto`; needs the extra `remote`."""
