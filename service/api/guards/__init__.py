"""Guards before all routes: who may come in, and how long a client may keep the server waiting."""
