"""What a run leaves in its folder, and how it is written so that no crash spoils it."""
