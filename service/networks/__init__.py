"""Uploaded road networks: untrusted, checked in a sandboxed process, stored as files."""
