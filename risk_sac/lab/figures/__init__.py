"""Commands that measure the figures and tables of the documents."""
