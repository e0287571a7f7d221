"""Reads any SUMO net, finds places for the patterns, cuts them out."""
