"""Scenario families, their scene spaces, and what an ODD makes of them."""
