"""Response bodies made from stored records. Pure, except for reading files of a run."""
