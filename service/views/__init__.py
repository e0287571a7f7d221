"""Response bodies made from stored records; read only files of runs."""
