"""Database of the service: tables, records, reading and writing.

Every function raises StorageError if the database cannot be read or written, and NotFoundError if the project has
nothing with the given id; no project means all projects.
"""
