"""The version of the definitions that violations are judged by."""

DEFINITIONS = 7  # raise it with whatever changes a verdict; what was judged before says by which it was
