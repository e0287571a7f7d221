from hypothesis import settings

# The first example pays for torch's lazy imports and for compilation, whichever it is.
settings.register_profile("first call may compile", deadline=None)
settings.load_profile("first call may compile")
