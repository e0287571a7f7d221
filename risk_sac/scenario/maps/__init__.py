"""Where the patterns fit on any net of SUMO's: reading it, finding places, cutting out a place's piece of it."""
