"""What is shown of what is stored. Pure, but for the files of a run."""
