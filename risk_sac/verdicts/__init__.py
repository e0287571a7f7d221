"""Pure judges of a contact: cause, course, and drivers that prevent it."""
