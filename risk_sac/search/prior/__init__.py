"""Shipped prior: script models, script libraries and samplers."""
