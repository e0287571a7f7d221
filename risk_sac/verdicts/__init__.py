"""Pure judges of a contact: what made it, how it came about, and who would have prevented it."""
