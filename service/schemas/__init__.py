"""Bodies of the responses."""
