"""Where runs execute: the seam, processes of this machine, and what they say."""
