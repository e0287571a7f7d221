"""Types, geometry and compiled code that all layers share."""
