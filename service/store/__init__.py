"""What the service keeps: tables, records of them, reading and writing.

Every function raises StorageError where the database cannot be read or written, and NotFoundError where the project has
nothing with the id that was given; no project means all of them.
"""
