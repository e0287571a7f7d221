"""Trains the shipped prior from script episodes before many egos."""
