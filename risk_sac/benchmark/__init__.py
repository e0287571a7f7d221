"""How soon search methods detect egos with known faults."""
