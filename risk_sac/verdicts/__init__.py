"""Pure judges of a contact: what made it, how it came about, and which driver would have prevented it."""
