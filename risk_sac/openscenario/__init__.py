"""Reads OpenSCENARIO XML with its roads and catalogs into scenario documents."""
