"""Routes, thin: parse, call the manager or the store, map errors once."""
