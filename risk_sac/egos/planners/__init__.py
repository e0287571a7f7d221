"""Planners of others behind the seam, each on a package that the extra `planners` brings."""
