"""A failure, or all episodes of runs, in the formats of other tools: one module a format, and one table of them."""
