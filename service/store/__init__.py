"""What the service keeps: tables, records of them, reading and writing."""
