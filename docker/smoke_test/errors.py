"""Why the smoke test stops."""


class SmokeError(Exception):
    """Something did not work; the message is the verdict."""


class NoEngineError(SmokeError):
    """Nothing here can build and run an image."""
